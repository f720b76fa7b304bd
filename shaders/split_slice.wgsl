// Split, last part: sets the workgroups of the walk, as many as the rays need and the slice may still start.

@compute @workgroup_size(1)
fn split_slice() {
    let listed = atomicLoad(&rays[LISTED]);
    let step = atomicLoad(&rays[STEP]);
    let before = atomicLoad(&rays[RAYS_BY_LEVEL + step - 1u]);
    atomicStore(&rays[RAYS_BY_LEVEL + step - 1u], before + (listed - atomicLoad(&rays[COUNTED])));
    atomicStore(&rays[COUNTED], listed);
    let first = atomicLoad(&rays[CAST]);
    let left = atomicLoad(&rays[GROUPS_LEFT]);
    let groups = min(left, (listed - first + GROUP_RAYS - 1u) / GROUP_RAYS);
    let end = min(listed, first + groups * GROUP_RAYS);
    atomicStore(&rays[FIRST], first);
    atomicStore(&rays[CAST], end);
    atomicStore(&rays[GROUPS_LEFT], left - groups);
    atomicStore(&rays[GROUPS_DONE], atomicLoad(&rays[GROUPS_DONE]) + groups);
    if step == LAST_STEP && end == listed {
        atomicStore(&rays[IS_DONE], 1u);
    }
    args[3] = groups;
    args[4] = 1u;
    args[5] = 1u;
}
