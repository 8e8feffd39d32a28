"""Gmsh files: the same content in text and binary, versions 2.2 and 4.1, gives the same mesh."""

import struct

import numpy as np
import pytest
import tiefmu
from tiefmu import mesh
from tiefmu.mesh.data import Mesh


def read(tmp_path, data: bytes, name="panel.msh") -> Mesh:
    (tmp_path / name).write_bytes(data)
    whole = Mesh()
    mesh.read_into(whole, tmp_path / name, name)
    return whole


NODES = {
    10: (0, 0, 0),
    20: (1, 0, 0),
    30: (1, 1, 0),
    40: (0, 1, 0),
    5: (2, 0.5, 0),
    60: (0, 0, 1),
    902: (0.5, 0.5, 0.1),
}
# id, type, physical group, entity, nodes
ELEMENTS = [
    (1, 15, 3, 1, [10]),
    (2, 1, 4, 1, [10, 20]),
    (71, 2, 7, 6, [20, 5, 30]),
    (72, 3, 5, 5, [10, 20, 30, 40]),
    (73, 2, 0, 8, [10, 20, 40]),
    (90, 4, 7, 1, [10, 20, 40, 60]),
]
DIMENSION = {15: 0, 1: 1, 2: 2, 3: 2, 4: 3}
NAMES = b'$PhysicalNames\n2\n0 3 "corner"\n2 5 "the panel"\n$EndPhysicalNames\n'


def text_2() -> bytes:
    nodes = "".join(f"{i} {x} {y} {z}\n" for i, (x, y, z) in NODES.items())
    elements = "".join(f"{i} {t} 2 {g} {e} {' '.join(map(str, n))}\n" for i, t, g, e, n in ELEMENTS)
    return (
        b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
        + NAMES
        + f"$Nodes\n{len(NODES)}\n{nodes}$EndNodes\n$Elements\n{len(ELEMENTS)}\n{elements}$EndElements\n".encode()
    )


def binary_2(order: str) -> bytes:
    nodes = b"".join(struct.pack(f"{order}i3d", i, *x) for i, x in NODES.items())
    elements = b"".join(
        struct.pack(f"{order}6i", t, 1, 2, i, g, e) + struct.pack(f"{order}{len(n)}i", *n) for i, t, g, e, n in ELEMENTS
    )
    return (
        b"$MeshFormat\n2.2 1 8\n" + struct.pack(f"{order}i", 1) + b"\n$EndMeshFormat\n" + NAMES
        + b"$Nodes\n%d\n" % len(NODES) + nodes + b"\n$EndNodes\n$Elements\n%d\n" % len(ELEMENTS) + elements
        + b"\n$EndElements\n"
    )  # fmt: skip


def groups() -> dict:
    return {(DIMENSION[t], e): [g] if g else [] for _, t, g, e, _ in ELEMENTS}


def text_4() -> bytes:
    lines = ["$Entities", " ".join(str(sum(d == k for d, _ in groups())) for k in range(4))]
    for (dimension, entity), tags in sorted(groups().items()):
        box = "0 0 0" if dimension == 0 else "0 0 0 1 1 1"
        lines.append(f"{entity} {box} {len(tags)} {' '.join(map(str, tags))}" + (" 1 -2" if dimension else ""))
    # one node to a parametric block
    lines += ["$EndEntities", "$Nodes", f"2 {len(NODES)} 5 902", f"2 5 0 {len(NODES) - 1}"]
    lines += [*map(str, list(NODES)[:-1]), *(f"{x} {y} {z}" for x, y, z in list(NODES.values())[:-1])]
    lines += [
        "2 6 1 1",
        "902",
        "0.5 0.5 0.1 0.25 0.75",
        "$EndNodes",
        "$Elements",
        f"{len(ELEMENTS)} {len(ELEMENTS)} 1 90",
    ]
    for i, t, _, e, n in ELEMENTS:
        lines += [f"{DIMENSION[t]} {e} {t} 1", f"{i} {' '.join(map(str, n))}"]
    return b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + NAMES + "\n".join([*lines, "$EndElements\n"]).encode()


def binary_4(order: str) -> bytes:
    def pack(kinds, *values):
        return struct.pack(order + kinds, *values)

    data = b"$MeshFormat\n4.1 1 8\n" + pack("i", 1) + b"\n$EndMeshFormat\n" + NAMES + b"$Entities\n"
    data += pack("4Q", *(sum(d == k for d, _ in groups()) for k in range(4)))
    for (dimension, entity), tags in sorted(groups().items()):
        box = [0.0] * (3 if dimension == 0 else 6)
        data += pack(f"i{len(box)}dQ{len(tags)}i", entity, *box, len(tags), *tags)
        data += pack("Qi", 1, -2) if dimension else b""
    data += b"\n$EndEntities\n$Nodes\n" + pack("4Q", 2, len(NODES), 5, 902)
    data += pack("3iQ", 2, 5, 0, len(NODES) - 1) + pack(f"{len(NODES) - 1}Q", *list(NODES)[:-1])
    data += b"".join(pack("3d", *x) for x in list(NODES.values())[:-1])
    data += pack("3iQ", 2, 6, 1, 1) + pack("Q", 902) + pack("5d", 0.5, 0.5, 0.1, 0.25, 0.75)
    data += b"\n$EndNodes\n$Elements\n" + pack("4Q", len(ELEMENTS), len(ELEMENTS), 1, 90)
    for i, t, _, e, n in ELEMENTS:
        data += pack("3iQ", DIMENSION[t], e, t, 1) + pack(f"{1 + len(n)}Q", i, *n)
    return data + b"\n$EndElements\n"


FILES = {
    "text 2.2": text_2(),
    "binary 2.2": binary_2("<"),
    "binary 2.2, other byte order": binary_2(">"),
    "text 4.1": text_4(),
    "binary 4.1": binary_4("<"),
    "binary 4.1, other byte order": binary_4(">"),
}


@pytest.mark.parametrize("name", FILES)
def test_ids_positions_and_groups(tmp_path, name):
    whole = read(tmp_path, FILES[name])
    assert dict(zip(whole.node_id.tolist(), map(tuple, whole.position.tolist()))) == NODES
    segments = {
        int(i): [int(whole.node_id[n]) for n in row if n >= 0] for i, row in zip(whole.segment_id, whole.segments)
    }
    assert segments == {71: [20, 5, 30], 72: [10, 20, 30, 40], 73: [10, 20, 40]}
    assert whole.warnings == []

    def nodes(group):
        return sorted(whole.node_id[whole.select_nodes("tie", group)].tolist())

    assert nodes("corner") == [10]
    assert nodes("4") == [10, 20]
    assert nodes("the panel") == [10, 20, 30, 40]
    assert nodes("7") == [5, 10, 20, 30, 40, 60]  # a surface and a volume of this number
    assert whole.segment_id[whole.select_segments("tie", "7")].tolist() == [71]
    for group in ("0", "5", "the"):
        with pytest.raises(tiefmu.SceneError, match=f"the mesh has no set '{group}'"):
            whole.select_nodes("tie", group)


@pytest.mark.parametrize("name", FILES)
def test_a_node_that_the_file_does_not_have(tmp_path, name):
    other = {
        "text": (b"71 20 5 30", b"71 20 6 30"),
        "bina": (struct.pack("<3Q", 20, 5, 30), struct.pack("<3Q", 20, 6, 30)),
    }
    old, new = other[name[:4]]
    if "2.2" in name:
        order = ">" if "other" in name else "<"
        old, new = b"20 5 30", b"20 6 30"
        if name[0] == "b":
            old, new = struct.pack(f"{order}3i", 20, 5, 30), struct.pack(f"{order}3i", 20, 6, 30)
    elif "other" in name:
        old, new = struct.pack(">3Q", 20, 5, 30), struct.pack(">3Q", 20, 6, 30)
    assert FILES[name].count(old) == 1
    with pytest.raises(tiefmu.SceneError) as error:
        read(tmp_path, FILES[name].replace(old, new))
    assert str(error.value) == "file: panel.msh: segment 71: node 6 is not in the mesh (ids 5..902)"


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_ends_early(tmp_path, name):
    whole = FILES[name]
    for size in range(40, len(whole) - 20, 7):
        try:
            read(tmp_path, whole[:size])
        except tiefmu.SceneError as error:
            assert "\n" not in str(error)


def test_second_order_and_unknown_types(tmp_path):
    data = (
        text_2()
        .replace(b"$Elements\n6\n", b"$Elements\n8\n")
        .replace(b"$EndElements", b"100 9 2 5 1 10 20 30 40 5 60\n101 93 2 5 1 10 20 30 40\n$EndElements")
    )
    whole = read(tmp_path, data)
    assert dict(zip(whole.segment_id.tolist(), whole.second_order.tolist())) == {71: 0, 72: 0, 73: 0, 100: 1}


def test_partitions_are_refused(tmp_path):
    with pytest.raises(tiefmu.SceneError, match="is partitioned; save it in one piece"):
        read(tmp_path, text_4().replace(b"$Entities", b"$PartitionedEntities\n1\n$EndPartitionedEntities\n$Entities"))


def test_ids_in_the_millions(tmp_path):
    data = text_2().replace(b"\n902 ", b"\n2147483648 ").replace(b"\n72 ", b"\n900000000000 ")
    whole = read(tmp_path, data)
    assert np.sort(whole.node_id)[-1] == 2147483648
    assert 900000000000 in whole.segment_id
