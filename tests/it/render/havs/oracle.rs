//! A ray through a list of faces, written out: every face is intersected in world coordinates, the fragments are sorted or
//! passed through a buffer of k, the gaps integrated by small steps. Nothing is shared with the renderer but the table.

use super::*;

/// Where the ray passes through a face.
#[derive(Clone, Copy)]
struct Hit {
    depth: f64,
    scalar: f64,
    /// Whether there is an active cell behind it.
    goes_on: bool,
}

/// The image of the job's faces. What is drawn with a buffer of `k` only, or sorted without limit.
pub fn image(job: &RenderJob, k: Option<usize>) -> RgbaImage {
    let (width, height) = (job.view.width_px, job.view.height_px);
    let pixels = (0..width * height).map(|p| pixel(job, p % width, p / width, k)).collect();
    RgbaImage { width, height, pixels }
}

fn pixel(job: &RenderJob, column: usize, row: usize, k: Option<usize>) -> [f32; 4] {
    let view = &job.view;
    let (px, py) = view.ray(column, row);
    let across = px * view.right + py * view.up;
    let (origin, direction) =
        if view.perspective { (view.eye, view.forward + across) } else { (view.eye + across, view.forward) };
    let mut arrived: Vec<Hit> = start(job).into_iter().collect();
    let faces = &job.faces.as_ref().unwrap().ids;
    arrived.extend(faces.iter().filter_map(|&face| hit(job, face, origin, direction)));
    let mut light = [0.0; 4];
    let mut last: Option<Hit> = None;
    for next in leave(arrived, k) {
        if let Some(last) = last {
            if next.depth < last.depth {
                continue;
            }
            if last.goes_on {
                integrate(job, last, next, direction.length(), &mut light);
            }
        }
        last = Some(next);
    }
    light.map(|v| v as f32)
}

/// In the order in which a buffer of k lets them go, or that of their depths.
fn leave(arrived: Vec<Hit>, k: Option<usize>) -> Vec<Hit> {
    let mut buffer: Vec<Hit> = Vec::new();
    let mut left = Vec::new();
    for hit in arrived {
        let at = buffer.partition_point(|held| held.depth <= hit.depth);
        buffer.insert(at, hit);
        if k.is_some_and(|k| buffer.len() > k) {
            left.push(buffer.remove(0));
        }
    }
    left.extend(buffer);
    left
}

/// Where the ray begins if the eye is in an active cell.
fn start(job: &RenderJob) -> Option<Hit> {
    let eye = job.view.eye;
    (0..job.mesh.topology.tets.len() as u32).filter(|&c| job.view.perspective && job.active.contains(c)).find_map(|c| {
        let ids = job.mesh.topology.tets[c as usize];
        let [a, b, c, d] = ids.map(|v| job.mesh.positions.world(v as usize));
        let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
        let weights = [volume(eye, b, c, d), volume(a, eye, c, d), volume(a, b, eye, d), volume(a, b, c, eye)];
        let sum: f64 = weights.iter().sum();
        let scalar = (0..4).map(|i| weights[i] / sum * f64::from(job.scalars.values()[ids[i] as usize])).sum();
        weights.iter().all(|w| w / sum >= 0.0).then_some(Hit { depth: 0.0, scalar, goes_on: true })
    })
}

fn hit(job: &RenderJob, face: u32, origin: DVec3, direction: DVec3) -> Option<Hit> {
    let topology = &job.mesh.topology;
    let ids = topology.connectivity().faces[face as usize];
    let [a, b, c] = ids.map(|v| job.mesh.positions.world(v as usize));
    let normal = (b - a).cross(c - a);
    // The direction has length 1 along the viewing direction: the parameter is the depth.
    let depth = normal.dot(a - origin) / normal.dot(direction);
    let place = origin + depth * direction;
    let area = |p: DVec3, q: DVec3| (p - place).cross(q - place).dot(normal) / normal.length_squared();
    let weights = [area(b, c), area(c, a), area(a, b)];
    if !(weights.iter().all(|w| *w > 0.0) && (depth > 0.0 || !job.view.perspective)) {
        return None;
    }
    let scalar = (0..3).map(|i| weights[i] * f64::from(job.scalars.values()[ids[i] as usize])).sum();
    let is_behind = |cell: u32| {
        let centroid: DVec3 =
            topology.tets[cell as usize].iter().map(|&v| 0.25 * job.mesh.positions.world(v as usize)).sum();
        (centroid - a).dot(normal) * direction.dot(normal) > 0.0
    };
    let goes_on = topology.connectivity().face_cells[face as usize]
        .iter()
        .any(|&c| c != NONE && job.active.contains(c) && is_behind(c));
    Some(Hit { depth, scalar, goes_on })
}

/// Optical depth of a step at most: of a depth of 5 in all, the midpoint rule leaves 5 / 24 of its square.
const STEP_DEPTH: f64 = 2e-3;

fn integrate(job: &RenderJob, from: Hit, to: Hit, length_per_depth: f64, light: &mut [f64; 4]) {
    let near = if job.view.perspective { job.view.near } else { f64::NEG_INFINITY };
    let at = |share: f64| from.scalar + share * (to.scalar - from.scalar);
    let first = ((near - from.depth) / (to.depth - from.depth)).max(0.0);
    if first >= 1.0 || to.depth == from.depth {
        return;
    }
    let tau_max = job.table.nodes().iter().fold(0.0, |most, n| n.tau.max(most));
    let mut cuts: Vec<f64> =
        job.table.nodes().iter().map(|n| (n.scalar - from.scalar) / (to.scalar - from.scalar)).collect();
    cuts.retain(|cut| *cut > first && *cut < 1.0);
    cuts.extend([first, 1.0]);
    cuts.sort_by(f64::total_cmp);
    for piece in cuts.windows(2) {
        let length = (piece[1] - piece[0]) * (to.depth - from.depth) * length_per_depth;
        let steps = 8 + (tau_max * length / STEP_DEPTH) as usize;
        let step = (piece[1] - piece[0]) / steps as f64;
        for i in 0..steps {
            let node = job.table.eval(at(piece[0] + (i as f64 + 0.5) * step));
            let depth = node.tau * step * (to.depth - from.depth) * length_per_depth;
            let opacity = (1.0 - light[3]) * -(-depth).exp_m1();
            for (sum, value) in light.iter_mut().zip([node.rgb[0], node.rgb[1], node.rgb[2], 1.0]) {
                *sum += opacity * value;
            }
        }
    }
}
