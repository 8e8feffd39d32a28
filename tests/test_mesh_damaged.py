"""Whatever a mesh or properties file holds, it is read or refused in one line."""

import numpy as np
import tiefmu
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tiefmu import mesh
from tiefmu.mesh import properties
from tiefmu.mesh.data import Mesh

WORDS = """*NODE *ELEMENT,TYPE=S4 *ELEMENT,TYPE=C3D8 *NSET,NSET=a *ELSET,ELSET=b *SURFACE,NAME=c *PART,NAME=p *END
*INCLUDE *INSTANCE,NAME=i,PART=p *NSET,NSET=a,ELSET=b GENERATE GRID CQUAD4 CHEXA CORD2R SET1 THRU BEGIN BULK + * $Nodes
$Elements $MeshFormat 2.2 4.1 0 1 8 $EndNodes id mass motion free # -1 1 2 3 4 5 1.5 1e400 nan 1.D0 1-3 99999999999
18446744073709551616 S1 SPOS a b c p i i.1 i.a"""
GAPS = [",", "\n", " ", "", ", ", "        "]
TEXTS = st.lists(st.tuples(st.sampled_from(WORDS.split()), st.sampled_from(GAPS)), max_size=60).map(
    lambda pairs: "".join(word + gap for word, gap in pairs)
)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=TEXTS, ending=st.sampled_from(["inp", "bdf", "msh"]))
def test_mesh_files(tmp_path, text, ending):
    path = tmp_path / f"a.{ending}"
    path.write_text(("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" if ending == "msh" else "") + text)
    whole = Mesh()
    try:
        mesh.read_into(whole, path, path.name)
    except tiefmu.SceneError as error:
        assert "\n" not in str(error)
        return
    for name in ("all", *whole.content.node_sets, *whole.content.element_sets, *whole.content.face_sets):
        for select in (whole.select_nodes, whole.select_segments):
            try:
                index = select("tie", name)
            except tiefmu.SceneError as error:
                assert "\n" not in str(error)
            else:
                assert index.dtype.kind == "i" and (index >= 0).all()


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=TEXTS, header=st.sampled_from(["", "id,mass\n", "id,motion,rotations\n"]))
def test_properties(tmp_path, text, header):
    path = tmp_path / "nodes.csv"
    path.write_text(header + text)
    try:
        columns = properties.read(path, "nodes.csv", np.arange(1, 6))
    except tiefmu.SceneError as error:
        assert str(error).startswith("mesh: properties: nodes.csv: ")
        return
    for column in columns.values():
        assert len(column.nodes) == len(column.values) and np.isfinite(column.values).all()
