"""Random drivelines, and the same in arithmetic of 200 digits, from the values of their elements and nothing else."""

import random

import mpmath as mp

import powertrain_ctrl as pt

RATIOS = (-6.0, -1.0, 0.5, 1.0, 2.5, 3.6, 18.0)
# exponents of inertia, stiffness, damping
ORDINARY = ((-3, 3), (2, 7), (-2, 2))
EXTREME = ((-8, 8), (-3, 12), (-6, 6))


def driveline(seed, spread=ORDINARY, most=8):
    """Trees and loops of all linear elements, with held, free and massless nodes, locked and open clutches."""
    rng = random.Random(seed)
    inertia, stiffness, damping = ((lambda limits=limits: 10.0 ** rng.uniform(*limits)) for limits in spread)
    count = rng.randint(2, most)
    bodies = [f"J{i}" for i in range(count)]
    elements = [pt.Inertia(body, J=inertia()) for body in bodies]
    ends, opened = bodies[:1], []

    def ratio():
        return rng.choice([*RATIOS, rng.uniform(0.3, 12.0)])

    def spring(name, a, b):
        return pt.SpringDamper(name, a, b, stiffness=stiffness(), damping=rng.choice([0.0, damping()]))

    kinds = {
        "spring": 5,
        "geared": 4,
        "damper": 1,
        "locked": 1,
        "open": 0.5,
        "gear": 1,
        "shaft": 1,
        "row": 1,
        "planet": 1,
    }
    for i, body in enumerate(bodies[1:]):
        parent, kind = rng.choice(ends), rng.choices(list(kinds), list(kinds.values()))[0]
        ends.append(body)
        if kind == "spring":
            elements.append(spring(f"s{i}", parent, body))
        elif kind == "damper":
            elements.append(pt.SpringDamper(f"s{i}", parent, body, stiffness=0.0, damping=damping()))
        elif kind in ("locked", "open"):
            elements.append(pt.Clutch(f"c{i}", parent, body, max_torque=10.0))
            opened += [f"c{i}"] if kind == "open" else []
        elif kind == "geared":
            elements += [pt.Gear(f"g{i}", parent, f"m{i}", ratio=ratio()), spring(f"s{i}", f"m{i}", body)]
        elif kind == "gear":
            elements.append(pt.Gear(f"g{i}", parent, body, ratio=ratio()))
        elif kind == "shaft":
            elements.append(
                pt.Shaft(f"h{i}", parent, body, stiffness=stiffness(), inertia=inertia(), damping=damping())
            )
        elif kind == "row":
            row = {parent: 1.0, body: -ratio()}
            elements.append(pt.Compliance(f"k{i}", row, stiffness=stiffness(), damping=rng.choice([0.0, damping()])))
        else:
            i0 = rng.choice([1.0, 2.0, rng.uniform(1.2, 4.0)])
            elements += [pt.Inertia(f"r{i}", J=inertia()), pt.Planetary(f"p{i}", parent, f"r{i}", body, ratio=i0)]
            held = rng.choice(["brake", "spring", "free"])
            if held == "brake":
                elements.append(pt.Clutch(f"b{i}", f"r{i}", max_torque=10.0))
            elif held == "spring":
                elements.append(spring(f"t{i}", f"r{i}", parent))
    if rng.random() < 0.3:
        elements.append(spring("across", *rng.sample(bodies, 2)))
    if rng.random() < 0.4:
        values = rng.choice(
            [{"stiffness": 10.0 * stiffness(), "damping": damping()}, {}, {"stiffness": 0.0, "damping": damping()}]
        )
        elements += [pt.Mass("v", m=100.0 * inertia())]
        elements += [pt.Tyre("y", rng.choice(bodies), "v", radius=rng.uniform(0.2, 0.6), **values)]
    for i in range(rng.choice([0, 0, 1, 2])):
        values = rng.choice([{"damping": damping()}, {"damping": 0.0, "stiffness": stiffness()}])
        elements.append(pt.Drag(f"d{i}", rng.choice(bodies), **values))
    car = pt.Driveline(*elements)
    return car.release(*opened) if opened else car


def massless(seed, spread=ORDINARY):
    """The same with many nodes without inertia: bodies taken away, springs and dampers in series, open differentials."""
    rng = random.Random(1000 + seed)
    car = driveline(seed, spread, most=7)
    inertia, stiffness, damping = ((lambda limits=limits: 10.0 ** rng.uniform(*limits)) for limits in spread)
    elements, released = list(car), car.released
    bodies = [e.name for e in elements if isinstance(e, pt.Inertia)]

    def spring(name, a, b):
        k, d = rng.choice([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
        return pt.SpringDamper(name, a, b, stiffness=k * stiffness(), damping=d * damping())

    for n, kind in enumerate(rng.sample(["gear", "series", "differential", "ladder"], rng.randint(1, 3))):
        (a, b), x, y = rng.sample(bodies, 2), f"x{n}", f"y{n}"
        if kind == "series":
            elements += [spring(f"{x}a", a, x), spring(f"{x}b", x, b)]
        elif kind == "gear":
            gear = pt.Gear(f"{x}g", x, y, ratio=rng.uniform(0.3, 8.0))
            elements += [spring(f"{x}a", a, x), gear, spring(f"{x}b", y, b)]
        elif kind == "ladder":
            elements += [spring(f"{x}{i}", *ends) for i, ends in enumerate([(a, x), (x, y), (y, b), (x, b)])]
        else:
            end = rng.choice([b, f"{x}w"])
            elements += [pt.Inertia(end, J=inertia())] if end != b else []
            elements += [pt.Differential(x, a, f"{x}l", f"{x}r")]
            elements += [spring(f"{x}a", f"{x}l", end), spring(f"{x}b", f"{x}r", end)]
    for body in bodies:
        fewer = [e for e in elements if e.name != body]
        try:
            pt.assemble(pt.Driveline(*fewer).release(*released) if released else pt.Driveline(*fewer))
        except pt.PowertrainError:
            continue  # one that is needed
        elements = fewer if rng.random() < 0.35 else elements
    return pt.Driveline(*elements).release(*released) if released else pt.Driveline(*elements)


class Exact:
    """``J``, rows of springs and dampers (name, row, k, d) and rows of constraints (name, row) over the nodes."""

    def __init__(self, car):
        self.nodes = list(car.nodes)
        at = {node: i for i, node in enumerate(self.nodes)}
        self.J, self.twists, self.constraints = mp.zeros(len(at)), [], []
        for e in car:
            match e:
                case pt.Inertia(name, J=value) | pt.Mass(name, m=value):
                    self.J[at[name], at[name]] += mp.mpf(value)
                case pt.Gear(name, a, b):
                    self.constraints.append((name, {at[a]: mp.mpf(1), at[b]: -mp.mpf(e.ratio)}))
                case pt.Planetary(name, sun, ring, carrier):
                    i0 = mp.mpf(e.ratio)
                    self.constraints.append((name, {at[sun]: mp.mpf(1), at[ring]: i0, at[carrier]: -1 - i0}))
                case pt.Differential(name, carrier, left, right):
                    row = {at[carrier]: mp.mpf(2), at[left]: mp.mpf(-1), at[right]: mp.mpf(-1)}
                    self.constraints.append((name, row))
                case pt.Clutch(name, a, b):
                    if name not in car.released:
                        self.constraints.append((name, {at[a]: mp.mpf(1)} | ({} if b is None else {at[b]: mp.mpf(-1)})))
                case pt.Tyre(name, wheel, body):
                    r = mp.mpf(e.radius)
                    row = {at[wheel]: mp.mpf(1), at[body]: -1 / r}
                    if e.stiffness is None:
                        self.constraints.append((name, row))
                    else:
                        self.twists.append((name, row, e.stiffness * r**2, e.damping * r**2))
                case _:
                    row = {pt.Drag: lambda e: {e.node: 1}, pt.Compliance: lambda e: e.coefficients}.get(
                        type(e), lambda e: {e.a: 1, e.b: -1}
                    )(e)
                    row = {at[node]: mp.mpf(value) for node, value in row.items()}
                    stiffness, loss = mp.mpf(e.stiffness), getattr(e, "loss_factor", 0.0)
                    stiffness = stiffness * mp.mpc(1, loss) if loss else stiffness
                    self.twists.append((e.name, row, stiffness, mp.mpf(e.damping)))
            if isinstance(e, pt.Shaft):
                for x, y, part in ((e.a, e.a, 3), (e.b, e.b, 3), (e.a, e.b, 6), (e.b, e.a, 6)):
                    self.J[at[x], at[y]] += mp.mpf(e.inertia) / part

    def response(self, s, node):
        """Every output under a load of 1 at a node, at the complex frequency s; constraints by their multipliers."""
        n, m = len(self.nodes), len(self.constraints)
        A, b = mp.zeros(n + m), mp.zeros(n + m, 1)
        A[:n, :n] = s**2 * self.J
        for _, row, k, d in self.twists:
            for i, x in row.items():
                for j, y in row.items():
                    A[i, j] += (k + s * d) * x * y
        for p, (_, row) in enumerate(self.constraints):
            for i, x in row.items():
                A[i, n + p] = A[n + p, i] = x
        b[self.nodes.index(node)] = 1
        q = mp.lu_solve(A, b)
        found = {f"{name}_angle": q[i] for i, name in enumerate(self.nodes)}
        found |= {f"{name}_speed": s * q[i] for i, name in enumerate(self.nodes)}
        found |= {f"{name}_acceleration": s**2 * q[i] for i, name in enumerate(self.nodes)}
        for name, row, k, d in self.twists:
            twist = sum(x * q[i] for i, x in row.items())
            found |= {f"{name}_twist": twist, f"{name}_torque": (k + s * d) * twist}
        return found | {f"{name}_torque": q[n + p] for p, (name, _) in enumerate(self.constraints)}

    def matrices(self):
        """M, D, K over an exact null space of the constraints."""
        n = len(self.nodes)
        rows = [[row.get(j, mp.mpf(0)) for j in range(n)] for _, row in self.constraints]
        pivots = []
        for j in reversed(range(n)):
            left = [i for i in range(len(pivots), len(rows)) if abs(rows[i][j]) > mp.mpf(10) ** -30]
            if not left:
                continue
            i, p = max(left, key=lambda i: abs(rows[i][j])), len(pivots)
            rows[i], rows[p] = rows[p], [x / rows[i][j] for x in rows[i]]
            rows = [
                row if k == p else [x - row[j] * y for x, y in zip(row, rows[p], strict=True)]
                for k, row in enumerate(rows)
            ]
            pivots.append(j)
        free = [j for j in range(n) if j not in pivots]
        T = mp.zeros(n, len(free))
        for c, j in enumerate(free):
            T[j, c] = 1
            for p, pivot in enumerate(pivots):
                T[pivot, c] = -rows[p][j]
        K = D = mp.zeros(len(free))
        for _, row, k, d in self.twists:
            twist = mp.matrix([[sum(x * T[i, c] for i, x in row.items()) for c in range(len(free))]])
            twist = twist.apply(lambda x: x if abs(x) > mp.mpf(10) ** -60 else mp.mpf(0))
            K, D = K + k * twist.T * twist, D + d * twist.T * twist
        return T.T * self.J * T, D, K
