"""Contacts, solved by sequential impulses in substeps, eight manifolds at a time.

Each substep solves all contacts with a soft push against overlap, moves the bodies, and now and then solves again without
the push, so that no energy stays from it ("relaxation"). Impulses are accumulated and clamped: normal impulses not below
zero, friction to the Coulomb CONE of the sum of the manifold's normal impulses, and the next substep begins with them.

After Macklin et al., "Small Steps in Physics Simulation" (2019), and Catto, "Solver2D" (2024). Relaxing after every second
substep instead of each costs a quarter less, and halves the creep of stacks and pyramids: every solve rounds the balance of
a stack a little, and fewer solves round less.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.batch import write_batch
from elys.sim_node.physics.kernels.batch_pass import solve_batch, store_impulses, warm_start
from elys.sim_node.physics.kernels.impact import bounce_contacts
from elys.sim_node.physics.kernels.integrator import integrate_positions, integrate_velocities, take_back, turn_over
from elys.sim_node.physics.kernels.joint_motion import turn_all
from elys.sim_node.physics.kernels.joints import has_joints, solve_joints, warm_start_joints
from elys.sim_node.physics.kernels.tables import FORCED, POINTS
from elys.sim_node.physics.kernels.team import meet, share

SWEEPS = 8  # over a batch that takes a blow: its points are coupled, and what one pass leaves comes back as a rebound
ENOUGH = 24  # batches of a group for each thread: fewer are done by one, while the others wait


@inner
def finish_contacts(work, first, last, substep, constants):
    """Keeps what batches [first, last) have found."""
    can_roll = constants.can_roll != 0
    for batch in range(first, last):
        store_impulses(
            work.batches,
            work.body_a,
            work.body_b,
            work.slots,
            batch,
            work.counts[batch],
            work.solver,
            work.flat_manifolds,
            can_roll,
        )
        for lane in range(batch * 8, batch * 8 + 8):
            work.manifolds[work.slots[lane]].impulse_time = substep


@inner
def finish_impacts(work, first, last):
    """Adds the impulses of bounces to those of the step."""
    for r in range(first, last):
        manifold = work.manifolds[work.rows[r].slot]
        for k in range(work.rows[r].point_count):
            manifold.step_impulse[k] += work.row_points[r * POINTS + k].step_impulse


@inner
def prepare_contacts(work, first, last, substep, constants):
    """Fills batches [first, last) for substeps of one length."""
    for batch in range(first, last):
        write_batch(
            work.batches,
            batch,
            work.counts[batch],
            work.body_a,
            work.body_b,
            work.slots,
            work.solver,
            work.drive,
            work.flat_manifolds,
            constants,
            substep,
        )


@inner
def batch_count(work, group):
    """How many batches a group has."""
    if group.last_span == group.first_span:
        return 0
    return work.spans[group.last_span - 1].last - work.spans[group.first_span].first


@inner
def span_share(span, thread, threads):
    """The batches of a colour that a thread solves; those that no colour was left for are solved by one, in their order."""
    if span.is_serial != 0:
        return (span.first, span.last) if thread == 0 else (span.last, span.last)
    return share(span.first, span.last, thread, threads)


@inner
def begin_substep(work, joints, g, group, first, last, h, number, team, thread, threads, constants):
    """What comes before the contacts: the end of the substep before, impacts, gravity and damping, for bodies [first, last)."""
    can_bounce = group.last_row > group.first_row or constants.can_bounce == FORCED
    is_jointed = has_joints(joints, g)
    if number > 0 and not can_bounce and not is_jointed:
        turn_over(work.held, first, last, work.solver_bodies, work.solver, work.drive, h)
        return
    if number > 0:
        take_back(work.held, first, last, work.solver_bodies, work.solver, work.drive, h)
        meet(team, threads)
        if joints is not None and is_jointed and thread == 0:
            turn_all(joints, work.held, group.first_body, group.last_body, work.solver_bodies, work.drives, 0.0)
    if can_bounce and thread == 0:
        bounce_contacts(
            work.solver_bodies,
            work.drives,
            work.rows,
            work.row_points,
            group.first_row,
            group.last_row,
            h,
            constants.bounce_speed,
        )
    meet(team, threads)
    integrate_velocities(work.held, first, last, work.solver, work.drive)


@inner
def move_bodies(work, joints, g, group, first, last, fixed_first, held_end, h, team, thread, threads):
    """Moves bodies [first, last) by their velocities for one substep, and what moves by itself along with every group."""
    integrate_positions(work.held, first, last, work.solver, h)
    if thread == 0:
        integrate_positions(work.held, fixed_first, held_end, work.solver, h)
    if joints is not None and has_joints(joints, g):
        meet(team, threads)
        if thread == 0:
            turn_all(joints, work.held, group.first_body, group.last_body, work.solver_bodies, work.drives, h)


@inner
def solve_group(work, joints, g, group, fixed_first, held_end, carries, strength, team, thread, threads, constants):
    """All substeps of a group. The passes stand in a loop because a call with True and one with False would be compiled twice."""
    h = strength.substep
    first, last = share(group.first_body, group.last_body, thread, threads)
    is_jointed = has_joints(joints, g)
    first_batch, last_batch = (0, 0)
    if group.last_span > group.first_span:
        all_first, all_last = work.spans[group.first_span].first, work.spans[group.last_span - 1].last
        first_batch, last_batch = share(all_first, all_last, thread, threads)
    prepare_contacts(work, first_batch, last_batch, h, constants)
    if thread == 0:
        for index in range(fixed_first, held_end):
            for k in range(6):
                work.solver_bodies[work.held[index]].displacement[k] = 0.0
    for substep in range(strength.substeps):
        begin_substep(work, joints, g, group, first, last, h, substep, team, thread, threads, constants)
        meet(team, threads)
        if substep == 0:
            for s in range(group.first_span, group.last_span):
                begin, end = span_share(work.spans[s], thread, threads)
                for batch in range(begin, end):
                    count = work.counts[batch]
                    warm_start(work.batches, work.body_a, work.body_b, batch, count, work.solver, constants)
                meet(team, threads)
            if joints is not None and is_jointed:
                if thread == 0:
                    warm_start_joints(joints, g, work.solver_bodies)
                meet(team, threads)
        passes = 2 if (substep + 1) % strength.relax_every == 0 else 1
        for number in range(2 if is_jointed else passes):
            if joints is not None and is_jointed:
                if thread == 0:
                    solve_joints(joints, g, work.solver_bodies, work.drives, h, number == 0, constants)
                meet(team, threads)
            if number == passes:  # joints alone are relaxed in every substep
                break
            for s in range(group.first_span, group.last_span):
                begin, end = span_share(work.spans[s], thread, threads)
                for batch in range(begin, end):
                    for sweep in range(SWEEPS):
                        has_blow = solve_batch(
                            work.batches,
                            work.body_a,
                            work.body_b,
                            batch,
                            work.counts[batch],
                            work.solver,
                            strength,
                            constants,
                            number == 0,
                            number == passes - 1,
                            sweep > 0,
                            carries,
                        )
                        if number > 0 or not has_blow:
                            break
                meet(team, threads)
            if number == 0:
                move_bodies(work, joints, g, group, first, last, fixed_first, held_end, h, team, thread, threads)
                meet(team, threads)
    take_back(work.held, first, last, work.solver_bodies, work.solver, work.drive, h)
    meet(team, threads)
    if joints is not None and is_jointed:
        if thread == 0:
            turn_all(joints, work.held, group.first_body, group.last_body, work.solver_bodies, work.drives, 0.0)
        meet(team, threads)
    finish_contacts(work, first_batch, last_batch, h, constants)
    if thread == 0:
        finish_impacts(work, group.first_row, group.last_row)


@inner
def has_turning(work, fixed_first, held_end):
    """Whether anything turns that moves by itself."""
    for index in range(fixed_first, held_end):
        v = work.solver_bodies[work.held[index]].velocity
        if v[3] != 0.0 or v[4] != 0.0 or v[5] != 0.0:
            return True
    return False


@inner
def is_shared(work, group, all_batches, has_fixed, threads):
    """Whether all threads solve a group together, colour by colour: it is more than one thread's part of all, and large.

    Others are solved by one thread each, side by side; but for one after the other where something moves by itself, which
    every group moves along.
    """
    batches = batch_count(work, group)
    return batches >= ENOUGH * threads and (has_fixed or batches * threads > all_batches)


@inner
def solve_all(work, held_end, joints, strengths, all_constants, team, thread, threads):
    """All substeps of a step, group by group: velocities and displacements of the held bodies, impulses of contacts and joints.

    The contacts' batches are filled first. Each of `threads` threads calls it with its number, and with the same `team` for all
    to meet in. `team` is None where there is one thread and `joints` where there are no joints. What each body and contact gets
    is the same however many threads there are.
    """
    constants = all_constants[0]
    groups = work.groups
    fixed_first = groups[groups.shape[0] - 1].last_body
    has_fixed = held_end > fixed_first
    carries = has_turning(work, fixed_first, held_end)
    all_batches = 0
    for g in range(groups.shape[0]):
        all_batches += batch_count(work, groups[g])
    owner = 0
    for g in range(groups.shape[0]):
        group = groups[g]
        if group.first_body == group.last_body:
            continue
        strength = strengths[group.strength]
        if team is not None and is_shared(work, group, all_batches, has_fixed, threads):
            meet(team, threads)
            solve_group(
                work, joints, g, group, fixed_first, held_end, carries, strength, team, thread, threads, constants
            )
            meet(team, threads)
            continue
        if owner == thread:
            solve_group(work, joints, g, group, fixed_first, held_end, carries, strength, None, 0, 1, constants)
        if not has_fixed:
            owner = (owner + 1) % threads
    meet(team, threads)


@kernel
def solve_contacts(work, held_end, strengths, all_constants):
    """A world without joints, in one thread: compiled without all that is of joints and threads."""
    solve_all(work, held_end, None, strengths, all_constants, None, 0, 1)


@kernel
def solve_jointed_contacts(work, held_end, joints, strengths, all_constants):
    """A world with joints, in one thread."""
    solve_all(work, held_end, joints, strengths, all_constants, None, 0, 1)


@kernel
def solve_shared_contacts(work, held_end, strengths, all_constants, team, thread, threads):
    """A world without joints, in several threads."""
    solve_all(work, held_end, None, strengths, all_constants, team, thread, threads)


@kernel
def solve_shared_jointed_contacts(work, held_end, joints, strengths, all_constants, team, thread, threads):
    """A world with joints, in several threads."""
    solve_all(work, held_end, joints, strengths, all_constants, team, thread, threads)
