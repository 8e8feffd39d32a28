"""Ports against the same scenes with every node moved and loaded by hand."""

import numpy as np
import pytest
import tiefmu
from fmu_calls import OK, Fmu, Instance, set_derivatives
from port_scenes import PORTS, Pair, exponential, line_of_slaves, names, ported, vector

SETTINGS = [  # formulation, rotations, inertia, reaction, geometry
    ("default", True, "lumped", "loads", "finite"),
    ("default", True, "consistent", "full", "finite"),
    ("default", True, "lumped", "full", "small"),
    ("default", False, "consistent", "split", "finite"),
    ("default", False, "lumped", "loads", "small"),
    ("optimized", False, "lumped", "full", "finite"),
    ("optimized", True, "consistent", "split", "finite"),
    ("optimized", False, "consistent", "full", "small"),
]
IDS = ["-".join(map(str, s)) for s in SETTINGS]


def same(pair: Pair, tolerance=1e-12, skip=()):
    """Every output that both scenes have."""
    count = 0
    for block in pair.ports.variables:
        if block["causality"] not in ("output", "calculatedParameter") or block["prefix"] == "port":
            continue
        if block["name"] in skip:
            continue
        found, expected = (s.get_values(names(block)) for s in (pair.ports, pair.nodes))
        np.testing.assert_allclose(
            found, expected, rtol=tolerance, atol=tolerance * (1 + np.abs(expected).max()), err_msg=block["name"]
        )
        count += len(found)
    assert count > 20


def hand_spread(pair: Pair, port: str, force, moment) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Loads of least squares on the port's slaves with that resultant about its reference point: node -> (f, t)."""
    nodes = pair.port[port]["nodes"]
    if len(nodes) == 1:
        lever = vector(pair.ports, f"port[{port}].r") - pair.of(nodes[0], "r")
        return {nodes[0]: (force, moment + np.cross(lever, force))}
    x = (
        np.array([pair.start[i] for i in nodes])
        if pair.made["model"]["geometry"] == "small"
        else np.array([pair.of(i, "r") for i in nodes])
    )
    centre = x.mean(axis=0)
    arms = x - centre
    lever = vector(pair.ports, f"port[{port}].r") - np.mean([pair.of(i, "r") for i in nodes], axis=0)
    # The smallest loads whose sum is the force and whose moment about the mean is the moment there.
    rows = np.vstack([np.hstack([np.eye(3)] * len(nodes)), np.hstack([cross_matrix(r) for r in arms])])
    loads = np.linalg.pinv(rows) @ np.concatenate([force, moment + np.cross(lever, force)])
    return {node: (f, np.zeros(3)) for node, f in zip(nodes, loads.reshape(-1, 3))}


def cross_matrix(r) -> np.ndarray:
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def load(pair: Pair, rng):
    """Random loads on every port of slaves, by hand in the scene without."""
    for port, row in pair.port.items():
        if row["moves"] != "slaves":
            continue
        force, moment = rng.normal(size=(2, 3))
        vector(pair.ports, f"port[{port}].f", force), vector(pair.ports, f"port[{port}].t", moment)
        for node, (f, t) in hand_spread(pair, port, force, moment).items():
            vector(pair.nodes, f"{pair.name[node]}.f", f)
            if f"{pair.name[node]}.t[1]" in pair.known:
                vector(pair.nodes, f"{pair.name[node]}.t", t)


def drive(pair: Pair, rng):
    """Random motions of every port of driven nodes."""
    accelerations = pair.made["model"]["reaction"] != "loads"
    for port, row in pair.port.items():
        if row["moves"] != "slaves":
            pair.drive(
                port,
                *rng.normal(size=(4 if accelerations else 2, 3)),
                finite=pair.made["model"]["geometry"] == "finite",
            )


@pytest.mark.parametrize("motions", ["driven", "mixed"])
@pytest.mark.parametrize("settings", SETTINGS, ids=IDS)
def test_an_instant(settings, motions):
    """Motions, loads, energies: as with the nodes moved and loaded one by one. A spring on a port's own nodes is in its
    resultant, which the other scene does not show: there is none here."""
    rng = np.random.default_rng(1)
    made = ported(rng, settings, motions=motions)
    made["spring"] = made["spring"][:2]
    made["node"][11]["motion"] = "driven"  # so that nothing has moved before the hand-made loads are computed
    made.pop("initial")
    pair = Pair(made)
    pair.initialise()
    for _ in range(3):
        drive(pair, rng), load(pair, rng)
        pair.both("slave[3].f", rng.normal(size=3))
        same(pair)
        base = pair.port["base"]
        forces = np.array([pair.of(i, "f") for i in base["nodes"]])
        arms = np.array([pair.arm("base", i) for i in base["nodes"]])
        moments = np.array([pair.of(i, "t") for i in base["nodes"]])
        np.testing.assert_allclose(vector(pair.ports, "port[base].f"), forces.sum(axis=0), atol=1e-11)
        np.testing.assert_allclose(
            vector(pair.ports, "port[base].t"), (np.cross(arms, forces) + moments).sum(axis=0), atol=1e-11
        )


@pytest.mark.parametrize("settings", SETTINGS, ids=IDS)
def test_a_port_of_slaves_moves_as_they_do_on_the_mean(settings):
    """v, w are the rigid motion closest to the slaves', and its power with f, t is that of the slaves' loads."""
    rng = np.random.default_rng(2)
    made = ported(rng, settings)
    pair = Pair(made)
    pair.initialise()
    drive(pair, rng), load(pair, rng)
    for port, row in pair.port.items():
        if row["moves"] != "slaves":
            continue
        force, moment = (vector(pair.ports, f"port[{port}].{key}") for key in "ft")
        v, w = (vector(pair.ports, f"port[{port}].{key}") for key in "vw")
        loads = hand_spread(pair, port, force, moment)
        power = sum(f @ pair.of(i, "v") + t @ pair.of(i, "w") for i, (f, t) in loads.items())
        np.testing.assert_allclose(force @ v + moment @ w, power, rtol=1e-11)
        np.testing.assert_allclose(sum(f for f, _ in loads.values()), force, atol=1e-12)
        about = vector(pair.ports, f"port[{port}].r")
        places = {i: pair.start[i] if made["model"]["geometry"] == "small" else pair.of(i, "r") for i in loads}
        np.testing.assert_allclose(
            sum(np.cross(places[i] - about, f) + t for i, (f, t) in loads.items()), moment, atol=1e-11
        )
        if len(loads) == 1:
            np.testing.assert_array_equal(w, pair.of(row["nodes"][0], "w"))


def all_driven(made: dict) -> dict:
    made["node"][11]["motion"] = "driven"
    made.pop("initial", None)
    return made


@pytest.mark.parametrize("settings", list(SETTINGS), ids=IDS)
def test_a_run_of_driven_nodes(settings):
    """The nodes of the other scene get the velocity that carries them from where they are to where the port takes them
    (and its rotation vector over the step), then the velocity they have there."""
    rng = np.random.default_rng(3)
    made = all_driven(ported(rng, settings))
    made["spring"] = made["spring"][:2]
    pair = Pair(made)
    pair.initialise()
    finite, h, time = settings[4] == "finite", 0.05, 0.0
    for _ in range(40):
        for port in ("base", "arm"):
            v, w = rng.normal(size=(2, 3)) * [[1], [3]]
            pair.drive(port, v, w)
            turn = exponential(h * w) if finite else np.eye(3)
            for node in pair.port[port]["nodes"]:
                if finite:
                    r = pair.arm(port, node)
                    vector(pair.nodes, f"{pair.name[node]}.v", v + (turn @ r - r) / h)
            pair.turned[port] = turn @ pair.turned[port]
        pair.ports.step(h), pair.nodes.step(h)
        time += h
        drive(pair, rng)
        # The work of the last step is summed from other velocities at its start.
        same(pair, 2e-12, skip={"power_residual", "energy.external", "energy.residual", "energy.dissipated"})
        place = vector(pair.ports, "port[base].r")
        if finite:
            for node in pair.port["base"]["nodes"]:
                np.testing.assert_allclose(pair.of(node, "r"), place + pair.arm("base", node), atol=1e-12)


@pytest.mark.parametrize("method", ["central-difference", "symplectic-euler", "noh-bathe", "rk4"])
def test_free_nodes_beside_a_translating_port(method):
    """Over substeps: with the nodes' velocities the same all along, so are the free nodes' motions."""
    rng = np.random.default_rng(4)
    made = ported(rng, ("default", True, "consistent", "split", "finite"), motions="mixed")
    made["integrator"] = {"method": method}
    pair = Pair(made)
    pair.initialise()
    for port in ("base", "arm"):
        pair.drive(port, rng.normal(size=3), np.zeros(3), rng.normal(size=3), np.zeros(3))
    for _ in range(20):
        pair.ports.step(0.02), pair.nodes.step(0.02)
    assert pair.ports.evaluations == pair.nodes.evaluations > 20
    same(pair, 1e-11, skip={"power_residual"})


@pytest.mark.parametrize(
    "method, order", [("central-difference", 2), ("symplectic-euler", 1), ("noh-bathe", 2), ("rk4", 3.5)]
)
def test_free_nodes_beside_a_turning_port(method, order):
    """Against many times smaller steps, and against nodes that get the port's velocities anew 2000 times."""
    rng = np.random.default_rng(5)
    made = ported(rng, ("default", True, "lumped", "full", "finite"), motions="mixed")
    made["integrator"] = {"method": method}
    v, w, a, z = rng.normal(size=(4, 3))

    def end(step):
        made["integrator"]["time_step"] = step
        pair = Pair(made)
        pair.initialise()
        pair.drive("base", v, w, 0 * a, 0 * z), pair.drive("arm", -v, w, 0 * a, 0 * z)
        pair.ports.step(1.0)
        return pair.ports.get("velocity")[-6:], pair

    (coarse, _), (fine, _), (finest, pair) = end(0.05), end(0.025), end(0.001)
    free = pair.ports.get("velocity")
    assert np.log2(np.abs(coarse - finest).max() / np.abs(fine - finest).max()) > order - 0.35
    count = 2000
    for _ in range(count):
        middle = {port: exponential(w / count / 2) @ turned for port, turned in pair.turned.items()}
        after = {port: exponential(w / count) @ turned for port, turned in pair.turned.items()}
        pair.turned = middle
        for port, speed in (("base", v), ("arm", -v)):
            for node in pair.port[port]["nodes"]:
                r = pair.arm(port, node)
                name = pair.name[node]
                vector(pair.nodes, f"{name}.v", speed + np.cross(w, r))
                if f"{name}.w[1]" in pair.known:
                    vector(pair.nodes, f"{name}.w", w)
                if f"{name}.a[1]" in pair.known:
                    vector(pair.nodes, f"{name}.a", np.cross(w, np.cross(w, r)))
        pair.nodes.step(1 / count)
        pair.turned = after
    np.testing.assert_allclose(free, pair.nodes.get("velocity"), atol=2e-3)


@pytest.mark.parametrize("formulation, rotations", [("default", True), ("optimized", False)])
def test_a_thousand_revolutions(formulation, rotations):
    rng = np.random.default_rng(6)
    made = all_driven(ported(rng, (formulation, rotations, "lumped", "loads", "finite")))
    made["interface"]["ports"][0]["nodes"] = list(range(1, 11))  # everything turns as one
    scene = tiefmu.load(made)
    simulation = scene.simulation()
    simulation.initialise(0.0)
    axis = np.array([1.0, -2.0, 2.0]) / 3
    start = simulation.get("slave_position")
    place = np.array(PORTS[0]["at"])
    steps, per = 7000, 2 * np.pi / 7
    vector(simulation, "port[base].w", per * axis)
    vector(simulation, "port[base].v", np.array([1e-3, 0.0, 0.0]))
    for _ in range(steps):
        simulation.step(1.0)
    moved = place + [1e-3 * steps, 0, 0]
    np.testing.assert_allclose(vector(simulation, "port[base].r"), moved, atol=1e-10)
    np.testing.assert_allclose(simulation.get("slave_position") - moved, start - place, atol=1e-10)
    assert simulation.get_values(["drift"])[0] < 1e-12
    # An odd part of a turn more.
    simulation.step(0.3)
    moved = moved + [3e-4, 0, 0]
    turned = (start - place) @ exponential(0.3 * per * axis).T
    np.testing.assert_allclose(simulation.get("slave_position") - moved, turned, atol=1e-10)
    # A port of slaves that ride on it has its motion, and its lever turns with them.
    lever = np.array(PORTS[2]["at"]) - place
    np.testing.assert_allclose(
        vector(simulation, "port[load].r") - moved, exponential(0.3 * per * axis) @ lever, atol=1e-10
    )
    np.testing.assert_allclose(vector(simulation, "port[load].w"), per * axis, atol=1e-12)
    np.testing.assert_allclose(
        vector(simulation, "port[load].v"),
        [1e-3, 0, 0] + np.cross(per * axis, exponential(0.3 * per * axis) @ lever),
        atol=1e-10,
    )


def test_loads_pass_from_a_port_of_slaves_to_one_of_masters_whole():
    rng = np.random.default_rng(7)
    made = all_driven(ported(rng, ("optimized", False, "lumped", "loads", "finite")))
    made["interface"]["ports"][0]["nodes"] = list(range(1, 11))
    made["spring"], made["model"]["gravity"] = [], [0.0, 0.0, 0.0]
    del made["interface"]["ports"][1]
    simulation = tiefmu.load(made).simulation()
    simulation.initialise(0.0)
    vector(simulation, "port[base].w", [0.3, 2.0, -1.0])
    for _ in range(5):
        simulation.step(0.3)
        force, moment = rng.normal(size=(2, 3))
        vector(simulation, "port[load].f", force), vector(simulation, "port[load].t", moment)
        arm = vector(simulation, "port[load].r") - vector(simulation, "port[base].r")
        np.testing.assert_allclose(vector(simulation, "port[base].f"), force, atol=1e-12)
        np.testing.assert_allclose(vector(simulation, "port[base].t"), moment + np.cross(arm, force), atol=1e-11)


def test_springs_on_a_ports_own_nodes_are_in_its_resultant():
    """The bushing between slave 101 and point 201, which is port `arm`, and the axial spring from there to node 5 of
    port `base`."""
    rng = np.random.default_rng(8)
    pair = Pair(ported(rng, ("default", False, "lumped", "loads", "finite")))
    pair.initialise()
    for _ in range(4):
        drive(pair, rng)
        slave, point, node = 101, 201, 5
        x = {
            201: vector(pair.ports, "port[arm].r"),
            101: pair.of(101, "r"),
            5: vector(pair.ports, "port[base].r") + pair.arm("base", 5),
        }
        v = {201: vector(pair.ports, "port[arm].v"), 101: pair.of(101, "v"), 5: pair.of(5, "v")}
        line, rest = x[slave] - x[point], pair.start[slave] - pair.start[point]
        bushing = np.array([3.0, 4.0, 5.0]) * (line - rest) + np.array([0.5, 0.7, 0.9]) * (v[slave] - v[point])
        gap = x[point] - x[node]
        n = gap / np.linalg.norm(gap)
        length = np.linalg.norm(pair.start[point] - pair.start[node])
        axial = -(2.0 * (np.linalg.norm(gap) - length) + 0.3 * n @ (v[point] - v[node])) * n  # on the point
        np.testing.assert_allclose(vector(pair.ports, "port[arm].f"), bushing + axial, atol=1e-12)
        own = np.array([pair.of(i, "f") for i in pair.port["base"]["nodes"]])
        np.testing.assert_allclose(vector(pair.ports, "port[base].f"), own.sum(axis=0) - axial, atol=1e-11)


@pytest.mark.parametrize("nodes", [(101, 102, 103), (102,)])
@pytest.mark.parametrize("at", [None, [1.0, 2.0, 3.0]])
def test_slaves_on_a_line_turn_about_it_by_their_own_rotations(nodes, at):
    rng = np.random.default_rng(9)
    made = line_of_slaves(True, at, nodes)
    simulation = tiefmu.load(made).simulation()
    simulation.initialise(0.0)
    place = at or np.mean([row[1:] for row in made["mesh"]["nodes"] if row[0] in nodes], axis=0)
    np.testing.assert_allclose(vector(simulation, "port[rod].r"), place, atol=1e-15)
    # All masters turn as a body about node 1: so does the port.
    x = np.array([row[1:] for row in made["mesh"]["nodes"][:4]])
    v, w = rng.normal(size=(2, 3))
    for i in range(4):
        vector(simulation, f"master[{i + 1}].v", v + np.cross(w, x[i])), vector(simulation, f"master[{i + 1}].w", w)
    np.testing.assert_allclose(vector(simulation, "port[rod].w"), w, atol=1e-12)
    np.testing.assert_allclose(vector(simulation, "port[rod].v"), v + np.cross(w, place), atol=1e-12)
    # Force and moment arrive at the masters whole.
    force, moment = rng.normal(size=(2, 3))
    vector(simulation, "port[rod].f", force), vector(simulation, "port[rod].t", moment)
    f = np.array([vector(simulation, f"master[{i}].f") for i in (1, 2, 3, 4)])
    t = np.array([vector(simulation, f"master[{i}].t") for i in (1, 2, 3, 4)])
    np.testing.assert_allclose(f.sum(axis=0), force, atol=1e-12)
    np.testing.assert_allclose((np.cross(x, f) + t).sum(axis=0), moment + np.cross(place, force), atol=1e-12)
    assert abs(simulation.get_values(["power_residual"])[0]) < 1e-12
    # Any other motion of the masters: what goes in comes out.
    for i in (1, 2, 3, 4):
        for key in "vw":
            vector(simulation, f"master[{i}].{key}", rng.normal(size=3))
    v, w = vector(simulation, "port[rod].v"), vector(simulation, "port[rod].w")
    motion = np.array([[vector(simulation, f"master[{i}].{key}") for i in (1, 2, 3, 4)] for key in "vw"])
    np.testing.assert_allclose(force @ v + moment @ w, (f * motion[0]).sum() + (t * motion[1]).sum(), rtol=1e-11)
    # The lever turns with the slaves, all of which turn about their line here.
    turn, members = np.array([0.9, 0.0, 0.0]), [node - 101 for node in nodes]
    for i in (1, 2, 3, 4):
        vector(simulation, f"master[{i}].v", np.zeros(3)), vector(simulation, f"master[{i}].w", turn)
    levers = []
    for step in (1.0, 1.0):
        levers.append(vector(simulation, "port[rod].r") - simulation.get("slave_position")[members].mean(axis=0))
        simulation.step(step)
        now = vector(simulation, "port[rod].r") - simulation.get("slave_position")[members].mean(axis=0)
        np.testing.assert_allclose(now, exponential(turn) @ levers[-1], atol=1e-12)
    assert (np.linalg.norm(levers[0]) > 1) == (at is not None)


def test_a_moving_input_turns_the_port_as_its_integral(tmp_path):
    """About a fixed axis exactly; about one that moves to fourth order in the step."""
    made = all_driven(ported(np.random.default_rng(10), ("default", True, "lumped", "loads", "finite")))
    fmu = Fmu(made, tmp_path)
    w, v, places = ([f"port[base].{key}[{k}]" for k in (1, 2, 3)] for key in "wvr")
    slave = [f"slave[3].r[{k}]" for k in (1, 2, 3)]  # rides on nodes 1..5, which the port has

    def run(spins, steps, shift=0.0):
        """Arm of the slave, at the start and after 1 s, and how far the reference point got."""
        instance = Instance(fmu).start()
        arms, start = [instance.get(slave) - instance.get(places)], instance.get(places)
        h = 1.0 / steps
        for k in range(steps):
            t = k * h
            assert instance.set(dict(zip(w + v, [*(np.array([1, t, t * t / 2]) @ spins), *[shift * t] * 3]))) == OK
            assert (
                set_derivatives(
                    instance,
                    w + w + v,
                    [1] * 3 + [2] * 3 + [1] * 3,
                    [*(spins[1] + t * spins[2]), *spins[2], *[shift] * 3],
                )
                == OK
            )
            assert instance.step(t, h) == OK, instance.log
        arms.append(instance.get(slave) - instance.get(places))
        moved = instance.get(places) - start
        instance.free()
        return *arms, moved

    axis = np.array([0.48, -0.6, 0.64])
    before, after, moved = run(np.array([0.5, 2.0, -3.0])[:, None] * axis, 3, shift=0.8)
    np.testing.assert_allclose(after, exponential((0.5 + 2.0 / 2 - 3.0 / 6) * axis) @ before, atol=1e-12)
    np.testing.assert_allclose(moved, 0.4 * np.ones(3), atol=1e-13)
    wobble = np.array([[0.4, -1.0, 0.7], [1.5, 0.8, -1.1], [-2.0, 1.0, 0.5]])
    exact = run(wobble, 2000)[1]
    errors = [np.abs(run(wobble, steps)[1] - exact).max() for steps in (4, 8, 16)]
    assert np.log2(errors[0] / errors[1]) > 3.6 and np.log2(errors[1] / errors[2]) > 3.7


@pytest.mark.parametrize(
    "settings",
    [s for s in SETTINGS if s[2:] == ("consistent", "full", "finite") or s[2:] == ("consistent", "split", "finite")],
    ids=lambda s: "-".join(map(str, s)),
)
def test_the_energy_balance_closes_with_the_order_of_the_method(settings):
    """Work of ports that turn and are loaded, beside free masters, springs, dampers and gravity."""
    made = ported(np.random.default_rng(5), settings, motions="mixed")
    made["integrator"] = {"method": "rk4"}
    motions = np.random.default_rng(7).normal(size=(4, 3))

    def residual(steps):
        simulation = tiefmu.load(made).simulation()
        vector(simulation, "port[base].v", motions[0]), vector(simulation, "port[base].w", motions[1])
        simulation.initialise(0.0)
        vector(simulation, "port[load].f", motions[2]), vector(simulation, "port[load].t", motions[3])
        for _ in range(steps):
            simulation.step(1 / steps)
        energy = simulation.get("energy")
        assert energy[0] > 100
        return abs(energy[4])

    coarse, fine, finest = residual(100), residual(200), residual(400)
    assert finest < 1e-9 and np.log2(coarse / fine) > 3.4 and np.log2(fine / finest) > 3.6
