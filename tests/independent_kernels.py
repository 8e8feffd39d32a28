"""The tie once more, from docs/theory.md alone: one segment, the search, rotations, one spring.

Shares no code with the project.
"""

import numpy as np


def cross(a, b):
    """Of two vectors (3, ...). NumPy's own serves many shapes, and takes ten times as long for one."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def skew(u):
    return np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])


# ---- one segment (theory 2, 4, 7) ------------------------------------------------------------------------------------


def shape(n, xi, eta):
    if n == 3:
        return np.array([1 - xi - eta, xi, eta])
    return 0.25 * np.array([(1 - xi) * (1 - eta), (1 + xi) * (1 - eta), (1 + xi) * (1 + eta), (1 - xi) * (1 + eta)])


def shape_gradient(n, xi, eta):
    """(2, n): d Phi / d xi, d Phi / d eta."""
    if n == 3:
        return np.array([[-1.0, 1, 0], [-1, 0, 1]])
    return 0.25 * np.array([[eta - 1, 1 - eta, 1 + eta, -1 - eta], [xi - 1, -1 - xi, 1 + xi, 1 - xi]])


class Projection:
    """Closest point of the extended surface: xi, eta, phi (n,), point, distance, outside (see `measure`)."""

    def __init__(self, corners, xi, eta, s):
        self.xi, self.eta = xi, eta
        self.phi = shape(len(corners), xi, eta)
        self.point = self.phi @ corners
        self.distance = np.linalg.norm(s - self.point)
        self.outside = np.max(1 - 2 * self.phi) if len(corners) == 3 else max(abs(xi), abs(eta))


def miss(x, target, at):
    """(m, 3): from the points to the places `at` (m, 2) on their quads."""
    return np.einsum("nm,mnk->mk", shape(4, *at.T), x) - target


def half(x, target, at):
    """(m,): half the squared distance, which the closest point makes smallest."""
    return 0.5 * np.sum(miss(x, target, at) ** 2, axis=1)


def local_coordinates(corners, s):
    """(m, 2): xi, eta of the closest points on m segments, corners (m, n, 3), of m points s (m, 3).

    Triangle: the normal equations. Quad: damped Newton from the centre on half the squared distance.
    """
    if corners.shape[1] == 3:
        edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        return np.einsum("mij,mj->mi", np.linalg.pinv(edges), s - corners[:, 0])
    u = np.zeros((len(s), 2))
    going = np.arange(len(s))
    for _ in range(200):
        x, target, at = corners[going], s[going], u[going]
        tangent = np.einsum("anm,mnk->mak", shape_gradient(4, *at.T), x)
        gradient = np.einsum("mak,mk->ma", tangent, miss(x, target, at))
        gauss_newton = tangent @ np.swapaxes(tangent, 1, 2)
        cross = np.einsum("mk,n,mnk->m", miss(x, target, at), [0.25, -0.25, 0.25, -0.25], x)  # miss . d2x / d xi d eta
        newton = gauss_newton + cross[:, None, None] * np.array([[0, 1], [1, 0]])
        # far from the surface the true Hessian can be indefinite; then Gauss-Newton still descends
        convex = np.linalg.eigvalsh(newton)[:, 0] > 0
        hessian = np.where(convex[:, None, None], newton, gauss_newton)
        move = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
        length = np.ones(len(going))
        for _ in range(10):
            further = half(x, target, at + length[:, None] * move) > half(x, target, at)
            uphill = further & (np.linalg.norm(move, axis=1) > 1e-7)
            length[uphill] /= 2
        u[going] = at + length[:, None] * move
        going = going[np.linalg.norm(move, axis=1) > 1e-13 * (1 + np.linalg.norm(at, axis=1))]
        if not len(going):
            break
    return u


def project(corners, s):
    corners, s = np.asarray(corners, float), np.asarray(s, float)
    return Projection(corners, *local_coordinates(corners[None], s[None])[0], s)


def clamp(corners, projection):
    """Phi for masses, inertias and stiffnesses (theory 4)."""
    if len(corners) == 3:
        phi = np.maximum(projection.phi, 0)
        return phi / phi.sum()
    return shape(4, np.clip(projection.xi, -1, 1), np.clip(projection.eta, -1, 1))


def mean_inertia(corners):
    """C, r (n, 3), Ibar of unit node masses."""
    centre = np.mean(corners, axis=0)
    r = corners - centre
    return centre, r, np.sum(r**2) * np.eye(3) - r.T @ r


def smallest_lambda(corners):
    """lambda: the largest eigenvalue of Ibar^-1."""
    return 1 / np.linalg.eigvalsh(mean_inertia(corners)[2])[0]


def default_map(phi, d, rotating=True):
    """T (6, 6 n): slave twist (v, w) from the masters' twists; d the offset from the projection."""
    blocks = []
    for p in phi:
        block = np.zeros((6, 6))
        block[:3, :3] = p * np.eye(3)
        if rotating:
            block[:3, 3:] = -p * skew(d)
            block[3:, 3:] = p * np.eye(3)
        blocks.append(block)
    return np.hstack(blocks)


def optimized_map(corners, d, r=None, ibar=None):
    """T (6, 6 n); d the offset from the barycentre; r and ibar only to freeze them elsewhere than at the corners."""
    if ibar is None:
        _, r, ibar = mean_inertia(corners)
    inverse = np.linalg.inv(ibar)
    blocks = []
    for ri in r:
        spin = inverse @ skew(ri)
        block = np.zeros((6, 6))
        block[:3, :3] = np.eye(3) / len(r) - skew(d) @ spin
        block[3:, :3] = spin
        blocks.append(block)
    return np.hstack(blocks)


def default_bias(phi, spins, d):
    """b (6,): w_P x (w_P x d); spins (n, 3)."""
    w = phi @ spins
    return np.concatenate([cross(w, cross(w, d)), np.zeros(3)])


def optimized_bias(corners, velocities, d):
    """b (6,) of theory 2, with dIbar/dt written out."""
    _, r, ibar = mean_inertia(corners)
    rate = velocities - velocities.mean(axis=0)
    ibar_rate = 2 * np.sum(r * rate) * np.eye(3) - r.T @ rate - rate.T @ r
    w = np.linalg.solve(ibar, cross(r.T, velocities.T).sum(axis=1))
    z = -np.linalg.solve(ibar, ibar_rate @ w)
    return np.concatenate([cross(z, d) + cross(w, cross(w, d)), z])


def lumped(corners, projection, offset, optimized, mass, inertia):
    """Added (mass, inertia) per master of the segment, (n, 2) (theory 4); offset = d. Also for theory (6.3)."""
    turned = inertia + mass * offset**2
    if optimized:
        n = len(corners)
        return np.column_stack([np.full(n, mass / n + turned * smallest_lambda(corners)), np.zeros(n)])
    phi = clamp(corners, projection)
    return np.column_stack([phi * mass, phi * turned])


# ---- search (theory 7), all segments ---------------------------------------------------------------------------------


def no_area(corners):
    a, b = (corners[1:] - corners[0]) if len(corners) == 3 else (corners[2] - corners[0], corners[3] - corners[1])
    edges = corners - np.roll(corners, 1, axis=0)
    return np.linalg.norm(cross(a, b)) < 1e-12 * np.max(np.sum(edges**2, axis=1))


def default_search_distance(position, segments, method="box"):
    """Root mean square of the segments' edges; for nearest-node the longest diagonal (edge of a triangle)."""
    corners = [position[np.array(s)] for s in segments]
    if method == "nearest-node":
        return max(np.linalg.norm(a - b) for x in corners for a in x for b in x)
    edges = [x - np.roll(x, 1, axis=0) for x in corners]
    return np.sqrt(np.mean(np.sum(np.vstack(edges) ** 2, axis=1)))


def edge_distance(corners, points):
    """(m,): distances of points (m, 3) to the nearest edge of one segment."""
    result = np.full(len(points), np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0)):
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        result = np.minimum(result, np.linalg.norm(points - a - t[:, None] * (b - a), axis=1))
    return result


def find(position, segments, ids, points, method, reach, tie=1e-9):
    """Per point: (index of the winning segment, its projection), or (None, None). segments: node index tuples."""
    usable = [e for e in range(len(segments)) if not no_area(position[list(segments[e])])]
    local = np.full((len(points), len(segments), 2), np.nan)
    outside, distance = (np.full((len(points), len(segments)), np.inf) for _ in range(2))
    for e in usable:
        corners = position[list(segments[e])]
        local[:, e] = local_coordinates(np.broadcast_to(corners, (len(points), *corners.shape)), points)
        phi = shape(len(corners), *local[:, e].T)
        outside[:, e] = np.max(1 - 2 * phi, axis=0) if len(corners) == 3 else np.abs(local[:, e]).max(axis=1)
        # to the closest point of the segment: its projection, or on an edge
        orthogonal = np.linalg.norm(phi.T @ corners - points, axis=1)
        distance[:, e] = np.where(outside[:, e] <= 1, orthogonal, edge_distance(corners, points))
    distance[outside > 1.5] = np.inf  # no candidate: a slave that far outside is not found there
    answer, slack, nodes = [], tie * reach, {n for e in usable for n in segments[e]}
    for k, s in enumerate(points):
        rated = usable
        if method == "nearest-node":
            gap = np.linalg.norm(position - s, axis=1)
            gap[[n not in nodes for n in range(len(position))]] = np.inf
            held = set(np.flatnonzero(gap <= gap.min() + slack)) if gap.min() <= reach else set()
            rated = [e for e in usable if held & set(segments[e])]
        best = min((distance[k, e] for e in rated), default=np.inf)
        if best > (reach if method == "box" else 1e300):
            answer.append((None, None))
            continue
        rated = [e for e in rated if distance[k, e] <= best + slack]
        least = min(outside[k, e] for e in rated)
        e = min((e for e in rated if outside[k, e] <= least + tie), key=lambda e: ids[e])
        answer.append((e, Projection(position[list(segments[e])], *local[k, e], s)))
    return answer


# ---- rotations and springs -------------------------------------------------------------------------------------------


def rotation_matrix(q):
    """Of a quaternion (w, x, y, z), any length."""
    w, x, y, z = q / np.linalg.norm(q)
    u = skew(np.array([x, y, z]))
    return np.eye(3) + 2 * w * u + 2 * u @ u


def quaternion_rate(q, w):
    """dq/dt for a spin w in the inertial frame."""
    return 0.5 * np.concatenate([[-w @ q[1:]], q[0] * w + cross(w, q[1:])])


def rotation_vector(q):
    """log of the rotation of a quaternion, length in [0, pi]."""
    q = q / np.linalg.norm(q) * (1 if q[0] >= 0 else -1)
    sine = np.linalg.norm(q[1:])
    return 2 * q[1:] if sine < 1e-9 else 2 * np.arctan2(sine, q[0]) / sine * q[1:]


def quaternion_product(a, b):
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], a[0] * b[1:] + b[0] * a[1:] + cross(a[1:], b[1:])])


def relative(q1, q2):
    """Quaternion of R1 R2^T."""
    return quaternion_product(q1, q2 * np.array([1, -1, -1, -1]))


def exponential(angle):
    """Quaternion of a rotation vector."""
    half = np.linalg.norm(angle) / 2
    return np.concatenate([[np.cos(half)], np.sinc(half / np.pi) * angle / 2])


class Spring:
    """One spring between bodies a and b (("node" | "slave", index) or None: ground)."""

    def __init__(self, table, a, b, xa, xb):
        def three(key):
            return np.broadcast_to(np.asarray(table.get(key, 0.0), float), 3)

        self.a, self.b, self.axial = a, b, table["kind"] == "axial"
        self.k, self.c = three("stiffness"), three("damping")
        self.kr, self.cr = three("rotational_stiffness"), three("rotational_damping")
        self.arm = xa - xb
        self.anchor = xb
        self.beam = None
        if table["kind"] == "beam":  # its axes at the start as columns
            along = self.arm / np.linalg.norm(self.arm)
            across = np.array(table.get("orientation", [0, 1, 0]), float)
            across = across - (across @ along) * along
            across /= np.linalg.norm(across)
            self.beam = np.column_stack([along, across, cross(along, across)])

    def strains(self, x1, x2, q1, q2):
        """Of a beam (6,): translations and rotations of its ends along its axes, theory (3.16), (3.17)."""
        theta = rotation_vector(relative(q2, q1))
        e = rotation_matrix(quaternion_product(exponential(theta / 2), q1)) @ self.beam
        u = e.T @ (x1 - x2)
        u[0] -= np.linalg.norm(self.arm)
        return np.concatenate([u, e.T @ theta])

    def beam_map(self, x1, x2, q1, q2):
        """(6, 12): how its strains change with small motions of a and b, by differences of fourth order."""
        h = 2e-4

        def moved(motion):
            u1, t1, u2, t2 = motion.reshape(4, 3)
            turned = [quaternion_product(exponential(t), q) for t, q in ((t1, q1), (t2, q2))]
            return self.strains(x1 + u1, x2 + u2, *turned)

        columns = [
            (8 * (moved(h * one) - moved(-h * one)) - (moved(2 * h * one) - moved(-2 * h * one))) / (12 * h)
            for one in np.eye(12)
        ]
        return np.column_stack(columns)

    def load(self, x1, x2, v1, v2, q1, q2, w1, w2):
        """Load (6,) on a, load on b, strain energy, dissipated power."""
        if self.beam is not None:  # what derives from the energy of its strains
            k, c = np.concatenate([self.k, self.kr]), np.concatenate([self.c, self.cr])
            strain, b = self.strains(x1, x2, q1, q2), self.beam_map(x1, x2, q1, q2)
            rate = b @ np.concatenate([v1, w1, v2, w2])
            load = -b.T @ (k * strain + c * rate)
            return load[:6], load[6:], 0.5 * k @ strain**2, c @ rate**2
        gap = x1 - x2
        if self.axial:
            length = np.linalg.norm(gap)
            u = gap / length
            stretch, rate = length - np.linalg.norm(self.arm), u @ (v1 - v2)
            f = -(self.k[0] * stretch + self.c[0] * rate) * u
            zero = np.zeros(3)
            return (
                np.concatenate([f, zero]),
                np.concatenate([-f, zero]),
                0.5 * self.k[0] * stretch**2,
                self.c[0] * rate**2,
            )
        stretch = gap - rotation_matrix(q2) @ self.arm
        rate = v1 - v2 - cross(w2, gap)
        angle, spin = rotation_vector(relative(q1, q2)), w1 - w2
        f = -self.k * stretch - self.c * rate
        m = -self.kr * angle - self.cr * spin
        return (
            np.concatenate([f, m]),
            np.concatenate([-f, -m - cross(gap, f)]),
            0.5 * (self.k @ stretch**2 + self.kr @ angle**2),
            self.c @ rate**2 + self.cr @ spin**2,
        )

    def strain_map(self):
        """(6, 12): small motions (u, theta) of a and b to strains, and their stiffnesses (6,)."""
        if self.beam is not None:
            one = np.array([1.0, 0, 0, 0])
            return self.beam_map(self.arm, 0 * self.arm, one, one), np.concatenate([self.k, self.kr])
        b = np.zeros((6, 12))
        if self.axial:
            u = self.arm / np.linalg.norm(self.arm)
            b[0, :3], b[0, 6:9] = u, -u
            return b, np.array([self.k[0], 0, 0, 0, 0, 0])
        b[:3, :3], b[:3, 6:9], b[:3, 9:] = np.eye(3), -np.eye(3), skew(self.arm)
        b[3:, 3:6], b[3:, 9:] = np.eye(3), -np.eye(3)
        return b, np.concatenate([self.k, self.kr])
