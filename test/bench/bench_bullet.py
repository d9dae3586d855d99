# SPDX-License-Identifier: BSD-3-Clause
"""The same hand in Bullet (pybullet): sixteen free bodies of the engine's augmented mass, pulled by the engine's own
spring law, against the same objects. Only stepSimulation is timed, not the springs in Python: in Bullet's favour."""
import os
import time

import numpy as np
import pybullet as p

HEADER_SPRING = np.dtype([("k_f", "f8"), ("d_f", "f8"), ("k_t", "f8"), ("d_t", "f8"), ("k_small", "f8"), ("mass", "f8"),
                          ("added_mass", "f8"), ("added_inertia", "f8"), ("d_f_implicit", "f8"), ("d_t_implicit", "f8"),
                          ("h", "f8"), ("law", "i4"), ("pad", "i4")])
STATE = np.dtype([("q", "f8", 4), ("p", "f8", 3), ("v", "f8", 3), ("w", "f8", 3)])
STEP = np.dtype([("placed", "i8"), ("limb", STATE, 16)])
LIMBS, PALM = 16, 15


def quat_mul(a, b):
    w = a[:, 0] * b[:, 0] - (a[:, 1:] * b[:, 1:]).sum(1)
    v = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
    return np.column_stack([w, v])


def quat_log(q):
    q = np.where(q[:, :1] < 0, -q, q)
    s = np.linalg.norm(q[:, 1:], axis=1)
    k = np.where(s > 1e-12, 2 * np.arctan2(s, q[:, 0]) / np.maximum(s, 1e-300), 2.0)
    return q[:, 1:] * k[:, None]


def rotate_inv(q, v):
    u = -np.array(q[1:])
    t = 2 * np.cross(u, v)
    return v + q[0] * t + np.cross(u, t)


def wxyz(q):
    return np.column_stack([q[:, 3], q[:, :3]])


def is_box(points):
    points = np.array(points)
    half = np.abs(points).max(0)
    return len(points) == 8 and np.allclose(np.abs(points), half, atol=1e-12)


def write_pieces(stem, pieces):
    """A compound of hulls is read from a file: one part for each, of whose triangles only the corners matter."""
    path, base = os.path.abspath(stem + ".obj"), 1
    with open(path, "w") as f:
        for k, piece in enumerate(pieces):
            f.write(f"o piece{k}\n" + "".join("v %.17g %.17g %.17g\n" % tuple(v) for v in piece))
            f.write("".join(f"f {base} {base + i} {base + i + 1}\n" for i in range(1, len(piece) - 1)))
            base += len(piece)
    return path


class Bullet:
    def __init__(self, scene, drivers_path, name):
        self.scene, self.name, self.drivers_path = scene, name, drivers_path
        assert scene["spring_bytes"] == HEADER_SPRING.itemsize, "gv_spring has changed: HEADER_SPRING must follow"
        raw = open(drivers_path, "rb").read()
        steps = scene["steps"]
        self.steps = np.frombuffer(raw[len(raw) - steps * STEP.itemsize:], STEP)
        spring = np.frombuffer(raw[16:16 + LIMBS * HEADER_SPRING.itemsize], HEADER_SPRING)
        self.spring = {k: spring[k][:, None] for k in HEADER_SPRING.names}
        p.connect(p.DIRECT)

    def reset(self):
        p.resetSimulation()
        p.setTimeStep(0.001)
        p.setGravity(*self.scene["gravity"])
        self.gravity = np.array(self.scene["gravity"])
        self.limbs = [self.make_limb(i, limb) for i, limb in enumerate(self.scene["limbs"])]
        self.objects = [self.make_object(o) for o in self.scene["objects"]]
        self.object = next(b for b, o in zip(self.objects, self.scene["objects"]) if o["name"] == self.name)
        everybody = list(zip(self.limbs, self.scene["limbs"])) + list(zip(self.objects, self.scene["objects"]))
        self.mass = {b: of["mass"] for b, of in everybody if not of.get("static")}
        self.mu = {b: of.get("mu", self.scene["mu_hand"]) for b, of in everybody}
        self.placed = False

    def make_limb(self, index, limb):
        r, half = limb["radius"], limb["half"]
        if index == PALM:
            shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[h + r for h in half])  # Bullet has no rounded box
        else:  # its capsules stand along z
            turn = p.getQuaternionFromEuler([0, np.pi / 2, 0])
            shape = p.createCollisionShape(p.GEOM_CAPSULE, radius=r, height=2 * half[0], collisionFrameOrientation=turn)
        body = p.createMultiBody(limb["mass"], shape, basePosition=[0, 0, 10 + index])
        self.settle(body, [limb["inertia"]] * 3, self.scene["mu_hand"])
        p.setCollisionFilterGroupMask(body, -1, 2, 1)  # limbs do not touch each other
        return body

    def make_object(self, o):
        pieces = o["pieces"]
        if len(pieces) == 1 and is_box(pieces[0]):
            shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=list(np.abs(np.array(pieces[0])).max(0)))
        elif len(pieces) == 1:
            shape = p.createCollisionShape(p.GEOM_MESH, vertices=pieces[0])
        else:
            shape = p.createCollisionShape(p.GEOM_MESH, fileName=write_pieces(self.drivers_path + "." + o["name"], pieces))
        q = o["quaternion"]
        body = p.createMultiBody(0 if o["static"] else o["mass"], shape, basePosition=o["position"],
                                 baseOrientation=[q[1], q[2], q[3], q[0]])
        self.settle(body, o["inertia"][:3], o["mu"])  # all objects here have their axes along the principal ones, nearly
        p.setCollisionFilterGroupMask(body, -1, 1, 3)
        return body

    @staticmethod
    def settle(body, inertia, mu):
        p.changeDynamics(body, -1, linearDamping=0, angularDamping=0, lateralFriction=mu, spinningFriction=0,
                         rollingFriction=0, restitution=0, localInertiaDiagonal=inertia, activationState=4)

    def place(self, driver):
        for body, T, q in zip(self.limbs, driver["p"], driver["q"]):
            p.resetBasePositionAndOrientation(body, T, [q[1], q[2], q[3], q[0]])
            p.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0])
        self.placed = True

    def pull(self, driver):
        s = self.spring
        pose = [p.getBasePositionAndOrientation(b) for b in self.limbs]
        speed = [p.getBaseVelocity(b) for b in self.limbs]
        x, q = np.array([a[0] for a in pose]), wxyz(np.array([a[1] for a in pose]))
        v, w = np.array([a[0] for a in speed]), np.array([a[1] for a in speed])
        turn = quat_log(quat_mul(driver["q"], q * [1, -1, -1, -1]))
        f = s["k_f"] * (driver["p"] - x) - s["d_f_implicit"] * (v - driver["v"])
        t = s["k_t"] * turn - s["d_t_implicit"] * (w - driver["w"])
        f = f - (s["mass"] + s["added_mass"]) * self.gravity  # gravity does not act on limbs
        for i, body in enumerate(self.limbs):
            p.applyExternalForce(body, -1, f[i], x[i], p.WORLD_FRAME)
            p.applyExternalTorque(body, -1, t[i], p.WORLD_FRAME)
        return dict(zip(self.limbs, f))

    # ---- residuals of the step that was done ----
    def velocities(self):
        return {b: np.array(p.getBaseVelocity(b)) for b in self.limbs + self.objects}

    def judge(self, before, pushed):
        """Residuals as in bench_drivers.h, and the number of contacts. What pybullet does not tell: the velocity with which
        its contacts let go of a penetration (so Signorini's law is that of a rigid contact, which closes a gap within the
        step and no more), and how it turns bodies (so momentum is the linear one alone)."""
        laws, after, contacts = np.zeros(4), self.velocities(), p.getContactPoints()
        impulse = {b: np.zeros(3) for b in after}
        for c in contacts:
            a, b, on_a, on_b, normal, f_n = c[1], c[2], np.array(c[5]), np.array(c[6]), np.array(c[7]), c[9]
            f_t = c[10] * np.array(c[11]) + c[12] * np.array(c[13])
            u = after[a][0] + np.cross(after[a][1], on_a - before[a][0]) - after[b][0] - np.cross(after[b][1], on_b - before[b][0])
            u_t = u - u.dot(normal) * normal
            bound = self.mu[a] * self.mu[b] * max(0.0, f_n)
            w_n = u.dot(normal) + max(0.0, c[8]) / 0.001
            laws[0] = max(laws[0], abs(min(w_n, f_n)))
            laws[1] = max(laws[1], np.linalg.norm(f_t) - bound)
            laws[2] = max(laws[2], abs(bound * np.linalg.norm(u_t) + f_t.dot(u_t)))
            impulse[a] += (f_n * normal + f_t) * 0.001
            impulse[b] -= (f_n * normal + f_t) * 0.001
        for b, mass in self.mass.items():
            gained = mass * (after[b][0] - before[b][1] - 0.001 * self.gravity)
            laws[3] = max(laws[3], np.linalg.norm(gained - impulse[b] - 0.001 * pushed.get(b, np.zeros(3))))
        return [*laws, len(contacts)]

    def run(self, first, count, laws=False):
        if first == 0:
            self.reset()
        out = np.zeros((count, 13 if laws else 8))
        for i in range(count):
            driver = self.steps[first + i]
            if not driver["placed"]:
                continue
            if not self.placed:
                self.place(driver["limb"])
            pushed = self.pull(driver["limb"])
            if laws:
                before = {b: (np.array(p.getBasePositionAndOrientation(b)[0]), np.array(p.getBaseVelocity(b)[0]))
                          for b in self.limbs + self.objects}
            start = time.perf_counter_ns()
            p.stepSimulation()
            whole = time.perf_counter_ns() - start
            palm, q = p.getBasePositionAndOrientation(self.limbs[PALM])
            at = np.array(p.getBasePositionAndOrientation(self.object)[0])
            in_palm = rotate_inv([q[3], q[0], q[1], q[2]], at - np.array(palm))
            out[i, :8] = [whole * 1e-3, 0, 0, 0, *in_palm, at[2]]
            if laws:
                out[i, 8:] = self.judge(before, pushed)
        return out
