"""Groups of islands that are solved one after the other, each through all substeps of a step before the next one begins.

Islands do not know of each other, so it does not matter in which order they are solved; but what is solved in many passes
should stay in the processor's cache from one pass to the next. So a group holds a thousand contacts or so, or one island that is
larger, all of one strength.
"""

from __future__ import annotations

from elys.sim_node.compilation import inner, kernel
from elys.sim_node.physics.kernels.islands import root_of
from elys.sim_node.physics.kernels.tables import DYNAMIC

MOST_CHUNKS = 48  # groups beside the first one of each strength
CHUNK = 1600  # contacts of a group: half a megabyte, about what a core keeps to itself


@inner
def open_group(groups, g, strength):
    groups[g].strength = strength
    groups[g].contacts = 0
    groups[g].first_body = groups[g].last_body = 0
    groups[g].first_span = groups[g].last_span = 0
    groups[g].first_row = groups[g].last_row = 0


@inner
def choose_group(groups, present, count, strength, island, chunk):
    """The group for an island and how many groups there are then; `present` (S,) are those that are being filled.

    What joints hold stays in the first group of its strength, as the joints' own groups do.
    """
    g = present[strength]
    if island.is_jointed != 0:
        return strength, count
    if groups[g].contacts > 0 and groups[g].contacts + island.contacts > chunk and count < groups.shape[0]:
        g = count
        open_group(groups, g, strength)
        present[strength] = g
        count += 1
    return g, count


@kernel
def form_groups(
    bodies, awake, awake_count, contact_count, parent, islands, strength_count, groups, present, held, group_of
):
    """Deals the islands out to groups and lists the rows of held bodies by group, those that no force moves last.

    Returns how many groups there are, the first `strength_count` of them one for each strength, and where the list of what no
    force moves ends; it begins where the last group ends.

    Parameters: groups (G,) with room for MOST_CHUNKS more than there are strengths; present (S,) int32 is room; held (N,) int32
    and group_of (N,) int32, the group of each held body, are written.
    """
    count = strength_count
    chunk = max(CHUNK, 2 * contact_count // MOST_CHUNKS)
    for g in range(strength_count):
        open_group(groups, g, g)
        present[g] = g
    for index in range(awake_count):
        i = awake[index]
        body = bodies[i]
        if body.held == 0 or body.motion != DYNAMIC:
            continue
        root = root_of(parent, i)
        island = islands[root]
        if root == i:  # the first of its island to come by
            g, count = choose_group(groups, present, count, body.strength, island, chunk)
            island.group = g
            groups[g].contacts += island.contacts
        group_of[i] = island.group
        groups[island.group].last_body += 1
    at = 0
    for g in range(count):
        groups[g].first_body = at
        at += groups[g].last_body
        groups[g].last_body = groups[g].first_body
    end = at
    for index in range(awake_count):
        i = awake[index]
        if bodies[i].held == 0:
            continue
        if bodies[i].motion == DYNAMIC:
            group = groups[group_of[i]]
            held[group.last_body] = i
            group.last_body += 1
        else:
            held[end] = i
            end += 1
    return count, end
