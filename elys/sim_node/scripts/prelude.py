"""Async functions that every script may await; written as scripts are, so that they are kept and gone on from like those."""

from elys.common.components import RigidBody
from elys.sim_node.scripts.easing import eased
from elys.sim_node.scripts.tweening import between, spin_between, turned
from elys.sim_node.scripts.waiting import Call, seconds, ticks, until


async def move_to(world, entity, position, rotation, duration, ease):
    start, before = entity.position, entity.rotation
    count = max(1, round(duration / world.dt))
    body = entity.get(RigidBody) if entity.has(RigidBody) else None
    is_carried = body is not None and body.motion == "kinematic"
    for number in range(1, count + 1):
        share = eased(number / count, ease)
        if position is not None:
            goal = start.lerp(position, share)
            if is_carried:  # by its velocity, so that it takes along what stands on it
                entity.velocity = (goal - entity.position) / world.dt
            else:
                entity.position = goal
        if rotation is not None:
            turn = turned(before, rotation, share)
            if is_carried:
                entity.spin = spin_between(entity.rotation, turn, world.dt)
            else:
                entity.rotation = turn
        await ticks(1)
    if position is not None:
        if is_carried:
            entity.velocity = (0.0, 0.0, 0.0)
        entity.position = position
    if rotation is not None:
        if is_carried:
            entity.spin = (0.0, 0.0, 0.0)
        entity.rotation = rotation


async def tween(world, entity, component, goals, duration, ease):
    first = entity.get(component)
    start = {name: getattr(first, name) for name in goals}
    count = max(1, round(duration / world.dt))
    for number in range(1, count + 1):
        share = eased(number / count, ease)
        now = {
            name: goal if number == count else between(component, name, start[name], goal, share)
            for name, goal in goals.items()
        }
        entity.set(component, **now)
        if number < count:
            await ticks(1)


async def every(behaviour, name, interval):
    began, number = behaviour.world.time, 0
    while True:
        number += 1
        await seconds(began + number * interval - behaviour.world.time)  # by the whole, so that nothing adds up
        answer = getattr(behaviour, name)()
        if isinstance(answer, Call):
            answer = await answer
        if answer is False:
            return


async def after(behaviour, name, delay, arguments):
    await ticks(max(1, round(delay / behaviour.world.dt)))
    answer = getattr(behaviour, name)(*arguments)
    if isinstance(answer, Call):
        await answer


async def animation_end(entity):
    clip, passes = entity.animation_passes
    await until(lambda: entity.animation_passes != (clip, passes))
