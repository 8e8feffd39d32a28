"""[model] reaction_lead: reactions that run ahead of the accelerations last set (theory 5.11 to 5.13).

Host and tie once more, in NumPy: four masters on springs, a slave without an offset between them, positions as inputs.
"""

import numpy as np
import pytest
import tiefmu
from fmu_calls import ERROR, OK, Fmu, Instance
from port_scenes import ported
from tiefmu._core import StepTooLong
from tiefmu.study import limits, stability_map

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
PHI = np.array([0.28, 0.12, 0.18, 0.42])  # of the slave at (0.3, 0.6)
OWN = 2.0  # of a master, kg
ORDERS = ["set, get, step", "host, set, step, get", "get, set, step"]


def scene(mass: float, reaction="split", lead=1.0, motion="driven", slave=(0.3, 0.6, 0.0), **model) -> dict:
    return {
        "mesh": {
            "nodes": [[i + 1, *x] for i, x in enumerate(CORNERS.tolist())] + [[101, *slave]],
            "segments": [[1, 1, 2, 3, 4]],
        },
        "node": [{"nodes": "all", "mass": OWN, "motion": motion}, {"nodes": [101], "mass": mass}],
        "tie": [{"name": "tie", "slaves": [101]}],
        "model": {"inertia": "consistent", "reaction": reaction, "reaction_lead": lead, "geometry": "small"} | model,
    }


def feedback(mass: float, reaction: str) -> np.ndarray:
    """f = B a, kg: theory (5.2), (5.3)."""
    tied = mass * np.outer(PHI, PHI)
    return np.diag(mass * PHI) - tied if reaction == "split" else -tied


class Tie:
    """What the theory says, of one direction: f = B (a + theta (a_1 - a_0))."""

    def __init__(self, mass, reaction, lead):
        self.feedback, self.lead = feedback(mass, reaction), lead
        self.now, self.last, self.change = np.zeros(4), None, np.zeros(4)

    def set(self, a):
        self.now = a

    def get(self):
        return self.feedback @ (self.now + self.lead * self.change)

    def step(self, size):
        if self.last is not None:
            self.change = self.now - self.last
        self.last = self.now


class Solver:
    """The same of the program: z components."""

    def __init__(self, mass, reaction, lead):
        self.simulation = tiefmu.load(scene(mass, reaction, lead)).simulation()
        self.simulation.initialise(0.0)

    def set(self, a):
        self.simulation.set("acceleration", np.outer(a, [0, 0, 1]))

    def get(self):
        return self.simulation.get("reaction_force")[:, 2]

    def step(self, size):
        self.simulation.step(size)


def run(tie, mass, reaction, order, sizes, omega=1.0, start=None):
    """Velocities of the host's nodes, which move by symplectic Euler, after every step."""
    carried = OWN + (mass * PHI if reaction == "split" else 0.0)
    u = np.array([1.0, -0.5, 0.3, 0.8]) if start is None else start
    v, f, rows = np.zeros(4), np.zeros(4), []
    a = -OWN * omega**2 * u / carried
    tie.set(a)
    for size in sizes:
        if order == "get, set, step":
            f = tie.get()
            tie.set(a)
            tie.step(size)
        elif order == "set, get, step":
            tie.set(a)
            f = tie.get()
            tie.step(size)
        a = (f - OWN * omega**2 * u) / carried
        v = v + size * a
        u = u + size * v
        if order == "host, set, step, get":
            tie.set(a)
            tie.step(size)
            f = tie.get()
        rows.append(v)
    return np.array(rows)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("reaction, mass, lead", [("split", 8.0, 1.0), ("split", 80.0, 0.4), ("full", 2.0, 0.5)])
def test_host_and_tie_move_as_in_one_program_of_their_own(order, reaction, mass, lead):
    """Steps of changing sizes."""
    sizes = np.random.default_rng(1).choice([0.01, 0.02, 0.05], 60)
    found, expected = (run(tie(mass, reaction, lead), mass, reaction, order, sizes) for tie in (Solver, Tie))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    without = run(Tie(mass, reaction, 0.0), mass, reaction, order, sizes)
    assert np.abs(without - expected).max() > 1e-3 * np.abs(expected).max()


def growth(order, reaction, r, lead, steps=400) -> float:
    """A step, of a host of free masses with a slave of r times their mass over one corner's share."""
    tie = Tie(0.0, reaction, lead)
    tie.feedback = np.diag([r, r, 0, 0]) * (1 if reaction == "split" else -1)
    a, f, sizes = np.array([1.0, -1.0, 0, 0]), np.zeros(4), []
    for _ in range(steps):
        if order == "get, set, step":
            f = tie.get()
        tie.set(a)
        if order == "set, get, step":
            f = tie.get()
        tie.step(1.0)
        if order == "host, set, step, get":
            f = tie.get()
        a = f / (1 + r if reaction == "split" else 1)
        sizes.append(np.abs(a).max())
    return (max(sizes[-20:]) / max(sizes[steps // 2 - 20 : steps // 2])) ** (2 / steps)


@pytest.mark.parametrize("lead", [0.25, 0.5, 1.0])
def test_accelerations_of_a_free_host_settle(lead):
    """In the first two orders for every r, in the third up to 1/(2 theta) only; `full` up to its own limits, and
    beyond them not: theory (5.12)."""
    for order in ORDERS[:2]:
        for r in (0.3, 3.0, 30.0):
            assert growth(order, "split", r, lead) < 1
    for factor, grows in ((0.98, False), (1.02, True)):
        assert (growth(ORDERS[2], "split", factor / (2 * lead), lead, 4000) > 1) == grows
        cubic = max(np.roots([lead + lead**2, lead, -1]))
        for order, end in zip(ORDERS, [min(cubic, 1 / (1 - 2 * lead) if lead < 0.5 else np.inf), 1 / (1 + 2 * lead)]):
            assert (growth(order, "full", factor * end, lead, 4000) > 1) == grows, (order, end)


def polynomial(r: float, step: float, present: bool) -> float:
    """Spectral radius of one step of a vibration that the slave does not move, without damping, host exact between
    communication points: (1 + r) u'' + u = F. present: the lead is the change of the accelerations set last."""
    w = step / np.sqrt(1 + r)
    turn = np.array([[np.cos(w), step * np.sin(w) / w], [-w * np.sin(w) / step, np.cos(w)]])
    matrix = np.zeros((5, 5))  # u, v, a, held, change
    load = r * np.array([0, 0, 2, -1, 0] if present else [0, 0, 1, 0, 1])
    matrix[:2, :2] = turn
    matrix[:2] += np.outer([1 - turn[0, 0], -turn[1, 0]], load)
    matrix[2] = (load - matrix[0]) / (1 + r)
    matrix[3, 2] = matrix[4, 2] = 1
    matrix[4, 3] = -1
    return np.abs(np.linalg.eigvals(matrix)).max()


@pytest.mark.parametrize("present, limit", [(True, np.sqrt(2 / 9)), (False, np.sqrt(3 / 32))])
def test_longest_step_of_an_undamped_host(present, limit):
    """Theory (5.13): H omega = limit / sqrt(r), for large r; found by the closed step of one vibration."""
    for r in (100.0, 1000.0):
        assert polynomial(r, 0.98 * limit / np.sqrt(r), present) < 1 - 1e-6
        assert polynomial(r, 1.02 * limit / np.sqrt(r), present) > 1 + 1e-6


@pytest.mark.parametrize("r", [1.0, 10.0, 100.0])
def test_limit_of_the_program_is_that_of_the_closed_step(r):
    """Within 2 %, by the host's step with the program's answers, and by runs where they need not be long."""
    low, high = 0.1 / np.sqrt(r), 0.4 / np.sqrt(r)
    while high / low > 1.001:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if polynomial(r, middle, False) <= 1 + 1e-10 else (low, middle)
    led = limits.plate(4 * r, "split", reaction_lead=1.0)
    for factor, grows in ((0.98, False), (1.02, True)):
        coupling = limits.coupled(led, "split", factor * low, omega=1.0)
        assert (coupling.radius() > limits.GROWS) == grows
        assert r > 10 or (coupling.growth(1500) > limits.GROWS) == grows
    held = limits.coupled(limits.plate(4 * r, "split"), "split", low / 2, omega=1.0)
    assert held.radius() > limits.GROWS  # without the lead at no step


def test_lead_damps_as_one_of_the_host():
    """Theory (5.9) to leading order: late by H ((1 - theta) r + 1/2 - theta)."""
    r, step = 10.0, 1e-3
    for lead in (0.0, 0.5, 1.0):
        made = limits.plate(4 * r, "split", reaction_lead=lead)
        roots = limits.coupled(made, "split", step, omega=1.0).roots()
        found = np.log(roots[np.abs(roots) > 1e-12].astype(complex)) / step
        rate = float(found[np.abs(found - 1j).argmin()].real)
        assert rate == pytest.approx(step * (r * (1 - lead) + 0.5 - lead) * r / (2 * (1 + r)), rel=0.02)


@pytest.mark.parametrize("r", [0.1, 0.5])
@pytest.mark.parametrize("reaction", ["split", "full"])
def test_without_delay_it_is_of_second_order(reaction, r):
    """At theta = (r + 1/2)/(r + 1) and (1 - r)/2 (theory 5.9, 5.11), of first order at others."""
    best = (r + 0.5) / (r + 1) if reaction == "split" else (1 - r) / 2

    def order(lead):
        scene, errors = limits.plate(4 * r, reaction, reaction_lead=lead), []
        for step in (0.02, 0.01):
            roots = limits.coupled(scene, reaction, step, omega=1.0).roots()
            errors.append(stability_map.worst(roots, r, step, 0.0))
        return np.log2(errors[0] / errors[1])

    assert order(best) == pytest.approx(2, abs=0.05)
    assert order(1.0) == pytest.approx(1, abs=0.2)


# ------------------------------------------------------------------------------------------------------------ the state


def accelerations(instance, values):
    names = [f"master[{i}].a[{k}]" for i in (1, 2, 3, 4) for k in (1, 2, 3)]
    assert instance.set(dict(zip(names, values))) == OK


def test_steps_taken_back_leave_nothing(tmp_path):
    """A trial step between two others, everywhere in a run: the same bits as without. A reset: as from the start."""
    fmu = Fmu(scene(3.0, geometry="finite"), tmp_path)
    loads = [f"master[{i}].f[{k}]" for i in (1, 2, 3, 4) for k in (1, 2, 3)]
    rng = np.random.default_rng(5)
    values, other = rng.normal(size=(6, 12)), rng.normal(size=12)

    def answers(instance, trial):
        rows = []
        for n, row in enumerate(values):
            if trial:
                state = instance.save()
                accelerations(instance, other)
                assert instance.step(n * 0.1, 0.05) == OK
                assert instance.restore(state) == OK
            accelerations(instance, row)
            rows.append(instance.get(loads))
            assert instance.step(n * 0.1, 0.1) == OK
            rows.append(instance.get(loads))
        return np.array(rows)

    instance = Instance(fmu).start()
    plain = answers(instance, False)
    np.testing.assert_array_equal(answers(Instance(fmu).start(), True), plain)
    assert instance.call("Reset") == OK
    np.testing.assert_array_equal(answers(instance.start(), False), plain)
    # what they are: of one direction as the theory says
    tie, expected = Tie(3.0, "split", 1.0), []
    for row in values:
        tie.set(row[2::3])
        expected.append(tie.get())
        tie.step(0.1)
        expected.append(tie.get())
    np.testing.assert_allclose(plain[:, 2::3], expected, atol=1e-14)


def test_a_step_that_fails_leaves_the_history():
    """Of a free point beside the tie that would take too many substeps."""
    made = scene(3.0)
    made["mesh"]["nodes"].append([201, 0.0, 0.0, 5.0])
    made["node"].append({"nodes": [201], "motion": "free", "mass": 1e-6})
    made["spring"] = [{"ground": [201], "kind": "bushing", "stiffness": 1e9}]
    simulation = tiefmu.load(made).simulation()
    simulation.initialise(0.0)
    rng = np.random.default_rng(2)
    for _ in range(2):
        simulation.set("acceleration", rng.normal(size=(5, 3)) * [[1], [1], [1], [1], [0]])
        simulation.step(1e-9)
    simulation.set("acceleration", np.ones((5, 3)))
    before = [simulation.get(name) for name in ("reaction_force", "held_acceleration", "acceleration_change")]
    assert np.abs(before[2]).max() > 0.1
    with pytest.raises(StepTooLong):
        simulation.step(1e9)
    for name, value in zip(("reaction_force", "held_acceleration", "acceleration_change"), before):
        np.testing.assert_array_equal(simulation.get(name), value)


def test_free_nodes_are_not_led():
    """Two masters driven, two free: what is added is that of the driven ones' change."""
    mass, steps = 3.0, np.random.default_rng(3).normal(size=(3, 2))
    forces = []
    for lead in (0.0, 0.6):
        made = scene(mass, lead=lead)
        made["node"].append({"nodes": [3, 4], "motion": "free"})
        simulation = tiefmu.load(made).simulation()
        simulation.initialise(0.0)
        ids = tiefmu.load(made).model.report()["nodes"]["id"].tolist()
        rows = [ids.index(i) for i in (1, 2, 3, 4)]
        for row in steps:
            a = simulation.get("acceleration")
            a[rows[:2], 2] = row
            simulation.set("acceleration", a)
            simulation.step(0.01)
        forces.append(simulation.get("reaction_force")[rows, 2])
    change = np.array([*(steps[2] - steps[1]), 0, 0])
    expected = 0.6 * feedback(mass, "split") @ change
    np.testing.assert_allclose((forces[1] - forces[0])[:2], expected[:2], rtol=1e-12)


def test_a_port_sums_what_is_led():
    """Resultants of its nodes' forces, each led by itself."""
    made = ported(np.random.default_rng(4), ("default", True, "consistent", "split", "finite"))
    pair = []
    for lead in (1.0, 0.0):
        made["model"]["reaction_lead"] = lead
        pair.append(tiefmu.load(made).simulation())
        pair[-1].initialise(0.0)
    rng = np.random.default_rng(6)
    for _ in range(3):
        a, w = rng.normal(size=(2, pair[0].fields["port_acceleration"]))
        for simulation in pair:
            simulation.set("port_acceleration", a)
            simulation.set("port_spin", w)
            simulation.step(0.02)
    base = [i in range(1, 7) for i in tiefmu.load(made).model.report()["nodes"]["id"].tolist()]
    led, plain = (s.get("reaction_force")[base].sum(axis=0) for s in pair)
    assert np.abs(led - plain).max() > 0.1
    found = pair[0].get("port_reaction") - pair[1].get("port_reaction")
    np.testing.assert_allclose(found.reshape(-1, 3)[0], led - plain, rtol=1e-9, atol=1e-9)


def test_power_that_the_lead_makes():
    """power_residual grows by theta (B (a_1 - a_0)).v less what was there: the price."""
    found = []
    for lead in (0.0, 1.0):
        made = scene(3.0, lead=lead) | {"interface": {"expose": ["power_residual"]}}
        simulation = tiefmu.load(made).simulation()
        simulation.initialise(0.0)
        v = np.random.default_rng(8).normal(size=(4, 3))
        for k in (1.0, 3.0):
            simulation.set("acceleration", k * v)
            simulation.set("velocity", v)
            simulation.step(0.01)
        found.append(float(simulation.get("power_residual")[0]))
    change = 2.0 * v
    assert found[1] - found[0] == pytest.approx(-np.sum((feedback(3.0, "split") @ change) * v), rel=1e-12)


@pytest.mark.parametrize(
    "changed, line",
    [
        ({"reaction": "loads"}, "'loads' answers to no accelerations; it is for 'split' and 'full'"),
        ({"motion": "free"}, "no node is driven, so there is no host that holds a reaction"),
    ],
)
def test_where_there_is_nothing_to_lead(changed, line):
    with pytest.raises(tiefmu.SceneError) as refused:
        tiefmu.load(scene(1.0, **changed))
    assert str(refused.value).endswith(f": model: reaction_lead: {line}")


def test_off_means_no_state_at_all(tmp_path):
    fields = tiefmu.load(scene(1.0, lead=0.0)).start.fields
    assert "acceleration_change" not in fields and "held_acceleration" not in fields
    instance = Instance(Fmu(scene(1.0), tmp_path)).start()
    accelerations(instance, np.ones(12))
    assert instance.step(0.0, -1.0) == ERROR  # refused: no step, no history
    assert instance.step(0.0, 0.1) == OK
    accelerations(instance, np.zeros(12))
    np.testing.assert_array_equal(instance.get([f"master[{i}].f[3]" for i in (1, 2, 3, 4)]), np.zeros(4))
