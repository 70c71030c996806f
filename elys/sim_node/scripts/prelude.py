"""Async functions that every script may await; written as scripts are, so that they are kept and gone on from like those."""

from elys.common.components import RigidBody
from elys.sim_node.scripts.waiting import ticks, until


async def move_to(world, entity, position, rotation, duration, ease):
    start = entity.position
    count = max(1, round(duration / world.dt))
    body = entity.get(RigidBody) if entity.has(RigidBody) else None
    is_carried = body is not None and body.motion == "kinematic"
    for number in range(1, count + 1):
        share = number / count
        if ease == "smooth":
            share = share * share * (3.0 - 2.0 * share)
        goal = start.lerp(position, share)
        if is_carried:  # by its velocity, so that it takes along what stands on it
            entity.velocity = (goal - entity.position) / world.dt
        else:
            entity.position = goal
        await ticks(1)
    if is_carried:
        entity.velocity = (0.0, 0.0, 0.0)
        entity.position = position
    if rotation is not None:
        entity.rotation = rotation


async def animation_end(entity):
    clip, passes = entity.animation_passes
    await until(lambda: entity.animation_passes != (clip, passes))
