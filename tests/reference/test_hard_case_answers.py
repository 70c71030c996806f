"""The answers of the hard cases, computed again by means that share nothing with the engine or the registry: scipy's integrators
and elementary algebra."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

from elys.samples.hard_cases import driven, jointed, moving, spinning

G = 9.81


def heavy_top(axis, spin, *, mass, arm, axial, across, seconds):
    """Axis (3, T) of a symmetric top on a fixed point and times (T,): dL/dt = arm axis x weight, da/dt = w x a."""

    def slope(_, state):
        a, momentum = state[:3], state[3:]
        along = momentum @ a
        w = momentum / across + (1.0 / axial - 1.0 / across) * along * a
        return [*np.cross(w, a), *np.cross(arm * a, [0.0, -mass * G, 0.0])]

    a = np.asarray(axis, float)
    w = np.asarray(spin, float)
    momentum = across * w + (axial - across) * (w @ a) * a
    times = np.linspace(0.0, seconds, 2001)
    found = solve_ivp(slope, [0.0, seconds], [*a, *momentum], t_eval=times, rtol=1e-10, atol=1e-12)
    return found.y[:3], times


GYROSCOPE = {"mass": spinning.MASS, "arm": spinning.ARM, "axial": spinning.AXIAL, "across": spinning.ACROSS}


def test_a_level_gyroscope_precesses_steadily():
    axis, times = heavy_top([1, 0, 0], [spinning.SPIN, spinning.PRECESSION, 0], **GYROSCOPE, seconds=10.0)
    assert np.abs(axis[1]).max() < 1e-7
    heading = np.unwrap(np.arctan2(-axis[2], axis[0]))
    np.testing.assert_allclose(heading, spinning.PRECESSION * times, atol=1e-6)


def test_a_gyroscope_that_is_let_go_dips_as_the_quadratic_says():
    axis, _ = heavy_top([1, 0, 0], [spinning.SPIN, 0, 0], **GYROSCOPE, seconds=3.0)
    assert math.asin(-axis[1].min()) == pytest.approx(spinning.released_dip(), rel=1e-5)
    assert axis[1].max() < 1e-9


@pytest.mark.parametrize(("share", "falls"), [(1.02, False), (0.9, True)])
def test_a_cone_stands_on_its_tip_from_the_sleeping_spin_on(share, falls):
    edge, mass = 0.4, 1.0
    axial, across = 0.3 * mass * (edge / 2) ** 2, mass * (0.15 * (edge / 2) ** 2 + 0.6 * edge**2)
    lean = 1e-4
    axis = [math.sin(lean), math.cos(lean), 0.0]
    spin = share * spinning.sleeping_spin() * np.array(axis)
    found, _ = heavy_top(axis, spin, mass=mass, arm=0.75 * edge, axial=axial, across=across, seconds=10.0)
    assert bool(found[1].min() < math.cos(100.0 * lean)) is falls
    assert 25.0 < spinning.sleeping_spin() < 120.0  # the spins of the two tops of the case


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def tippe_slope(_, state, speed):
    """A ball whose middle of mass is off its own, on a plane, with Coulomb friction that fades below `speed` [m/s].

    State: axis (3), velocity of the middle of mass along x and z, angular velocity (3). Plain numbers: the slip nearly stops
    at each nod, and there are many steps.
    """
    mass, low, axial, across = spinning.tippe_masses()
    a, w = state[:3], state[5:]
    arm = (low * a[0], low * a[1] - spinning.TIPPE_RADIUS, low * a[2])  # from the middle of mass to the ground
    turning, swept = cross(w, a), cross(w, arm)
    slip_x, slip_z = state[3] + swept[0], state[4] + swept[2]
    fade = -spinning.TIPPE_FRICTION / math.hypot(slip_x, slip_z, speed)
    push = (fade * slip_x, 1.0, fade * slip_z)

    def turned(moment):
        along = (1.0 / axial - 1.0 / across) * sum(m * n for m, n in zip(moment, a, strict=True))
        return tuple(moment[i] / across + along * a[i] for i in range(3))

    along = (axial - across) * sum(m * n for m, n in zip(w, a, strict=True))
    driven = turned(cross(arm, push))
    free = turned(cross(tuple(across * w[i] + along * a[i] for i in range(3)), w))
    # The ball stays on the ground: the height of the middle of mass follows from the axis.
    load = (G - low * (cross(free, a)[1] + cross(w, turning)[1])) / (1.0 / mass + low * cross(driven, a)[1])
    return [*turning, load * push[0] / mass, load * push[2] / mass, *(load * driven[i] + free[i] for i in range(3))]


def test_a_tippe_top_nods_as_far_as_the_registry_says():
    lean = spinning.TIPPE_LEAN
    axis = np.array([-math.sin(lean), math.cos(lean), 0.0])
    start = [*axis, 0.0, 0.0, *(spinning.TIPPE_SPIN * axis)]
    begin, end = spinning.TIPPE_WINDOW
    leans = []
    for speed in (4e-3, 1e-3):
        found = solve_ivp(
            tippe_slope,
            [0.0, end],
            start,
            args=(speed,),
            t_eval=np.linspace(begin, end, 1501),
            rtol=1e-8,
            atol=1e-10,
            method="DOP853",
        )
        leans.append(math.acos(found.y[1].min()))
    # The less friction fades the less it leans, down to the registry's figure.
    assert leans[0] > leans[1]
    assert leans[1] == pytest.approx(spinning.TIPPE_LEANS, abs=math.radians(0.1))


def test_a_heavy_chain_passes_below_its_hook_when_the_registry_says():
    """Rods of even mass and a ball that is stiff against the last hinge, in angles from the vertical: M(q) q'' = f(q, q')."""
    count, link, mass = jointed.CHAIN_LINKS, jointed.LINK, jointed.LINK_MASS
    thick = 0.06
    lengths = np.array([link] * count + [0.5 * jointed.CHAIN_BALL])
    # Of body i, the share of its own rod between its hinge and its middle; the ball's middle is half a diameter off.
    shares = np.array([0.5] * count + [1.0])
    masses = np.array([mass] * count + [jointed.CHAIN_BALL_MASS])
    own = np.array([mass * (link**2 + thick**2) / 12.0] * count)
    own = np.append(own, 0.4 * jointed.CHAIN_BALL_MASS * (0.5 * jointed.CHAIN_BALL) ** 2)
    # Middle of body i = sum_j reach[i, j] (sin q_j, -cos q_j).
    reach = np.tril(np.broadcast_to(lengths, (count + 1, count + 1)), -1) + np.diag(shares * lengths)
    coupling = np.einsum("i,ij,ik->jk", masses, reach, reach)
    weight = G * masses @ reach

    def slope(_, state):
        q, speed = state[: count + 1], state[count + 1 :]
        difference = q[:, None] - q[None, :]
        matrix = coupling * np.cos(difference) + np.diag(own)
        force = -(coupling * np.sin(difference)) @ speed**2 - weight * np.sin(q)
        return [*speed, *np.linalg.solve(matrix, force)]

    def below(_, state):
        return lengths @ np.sin(state[: count + 1])

    below.terminal = True
    start = [jointed.CHAIN_LEAN] * (count + 1) + [0.0] * (count + 1)
    found = solve_ivp(slope, [0.0, 3.0], start, rtol=1e-9, atol=1e-11, events=below)
    assert pytest.approx(found.t_events[0][0], rel=1e-5) == jointed.CHAIN_PASSES


def test_the_four_bars_close():
    crank = np.linspace(0.0, 2.0 * math.pi, 25)
    coupler, rocker = jointed.four_bar_angles(crank)

    def gap(angles, at):
        across = jointed.CRANK * math.cos(at) + jointed.COUPLER * math.cos(angles[0])
        up = jointed.CRANK * math.sin(at) + jointed.COUPLER * math.sin(angles[0])
        return [
            across - jointed.BASE - jointed.ROCKER * math.cos(angles[1]),
            up - jointed.ROCKER * math.sin(angles[1]),
        ]

    for at, *angles in zip(crank, coupler, rocker, strict=True):
        np.testing.assert_allclose(fsolve(gap, angles, args=(at,), xtol=1e-12), angles, atol=1e-8)
    assert (np.sin(rocker) > 0.0).all()


def test_the_planks_hang_in_balance():
    """At every joint the parts of the bridge on one side, held by the tension there, do not turn about any other joint."""
    angles = driven.hanging_angles()
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert ways.sum(axis=0) * 0.27 == pytest.approx([driven.BRIDGE_SPAN, 0.0], abs=1e-9)
    # Tension at the left of plank 1: its moments about the right ends of the first k planks must cancel the weights'.
    joints = np.vstack([[0.0, 0.0], np.cumsum(ways, axis=0)])
    middles = 0.5 * (joints[:-1] + joints[1:])

    def moment(force, k):
        arm = joints[0] - joints[k]
        weights = -(middles[:k, 0] - joints[k, 0]).sum()
        return arm[0] * force[1] - arm[1] * force[0] + weights

    force = fsolve(lambda f: [moment(f, 1), moment(f, driven.PLANKS)], [-1.0, 1.0])
    assert max(abs(moment(force, k)) for k in range(1, driven.PLANKS + 1)) < 1e-6


def test_the_ball_rolls_when_friction_has_turned_it():
    radius, mu = 0.5, moving.SLIP_FRICTION

    def slope(_, state):
        slip = state[1] - radius * state[2]
        force = mu * G * np.clip(slip / 1e-6, -1.0, 1.0)
        return [state[1], -force, force * radius / (0.4 * radius**2)]

    found = solve_ivp(slope, [0.0, 2.0], [0.0, moving.SLIP_SPEED, 0.0], method="Radau", rtol=1e-8, atol=1e-10)
    assert found.y[0, -1] == pytest.approx(moving._rolling_distance(2.0), rel=1e-5)
    assert found.y[1, -1] == pytest.approx(5.0 / 7.0 * moving.SLIP_SPEED, rel=1e-5)


def test_infinitely_many_bounces_end_when_the_series_does():
    time, speed = 0.0, 0.0
    height = moving.ZENO_DROP
    for _ in range(200):
        landing = brentq(lambda t, h=height, v=speed: h + v * t - 0.5 * G * t * t, 1e-15 + 2.0 * speed / G * 0.999, 2.0)
        time += landing
        speed, height = moving.ZENO_RESTITUTION * (G * landing - speed), 0.0
        if speed < 1e-9:
            break
    assert time == pytest.approx(moving.ZENO_TIME, rel=1e-7)


def test_a_spring_hangs_and_swings_as_its_closed_form():
    rate = 2.0 * math.pi * driven.SOFT
    times = np.linspace(0.0, 2.0, 121)
    found = solve_ivp(
        lambda _, s: [s[1], G - rate**2 * s[0]], [0.0, 2.0], [0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(found.y[0], G / rate**2 * (1.0 - np.cos(rate * times)), atol=1e-8)
