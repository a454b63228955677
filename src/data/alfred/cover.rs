//! Covering a scatter of points by a few rectangles that avoid blocked places: the outline of an L-shaped counter.

use crate::domain::place::Rect;

/// How many rectangles an outline may take.
const MOST: usize = 5;
/// Points that fewer than this share of all would add are not worth another rectangle.
const WORTH: f32 = 0.02;

/// The part of `outline` that is free of `blocked`, as few rectangles that overlap as they need to. Each covers `points`
/// that the ones before it left; where nothing is blocked, it is `outline` itself.
pub(crate) fn cover(outline: Rect, points: &[[i32; 2]], blocked: &[Rect]) -> Vec<Rect> {
    let blocked: Vec<Rect> = blocked.iter().copied().filter(|rect| overlap(rect, &outline)).collect();
    if blocked.is_empty() {
        return vec![outline];
    }
    let cuts = |axis: usize| -> Vec<i32> {
        let inner = blocked.iter().flat_map(|rect| [rect.min[axis], rect.max[axis]]);
        let range = outline.min[axis]..=outline.max[axis];
        let mut cuts: Vec<i32> =
            inner.chain([*range.start(), *range.end()]).filter(|cut| range.contains(cut)).collect();
        cuts.sort_unstable();
        cuts.dedup();
        cuts
    };
    let (xs, zs) = (cuts(0), cuts(1));
    let free = free_rectangles(&xs, &zs, &blocked);
    let mut left: Vec<[i32; 2]> = points.iter().copied().filter(|p| outline.contains(p[0], p[1])).collect();
    let enough = ((left.len() as f32 * WORTH) as usize).max(1);
    let mut chosen = Vec::new();
    while chosen.len() < MOST && left.len() >= enough {
        let gain = |rect: &Rect| left.iter().filter(|p| rect.contains(p[0], p[1])).count();
        let area = |rect: &Rect| i64::from(rect.max[0] - rect.min[0]) * i64::from(rect.max[1] - rect.min[1]);
        let Some(best) = free.iter().max_by_key(|rect| (gain(rect), area(rect))) else { break };
        if gain(best) < enough {
            break;
        }
        let best = *best;
        left.retain(|p| !best.contains(p[0], p[1]));
        chosen.push(best);
    }
    chosen
}

/// Whether two rectangles share more than an edge.
pub(crate) fn overlap(a: &Rect, b: &Rect) -> bool {
    (0..2).all(|axis| a.min[axis] < b.max[axis] && b.min[axis] < a.max[axis])
}

/// The rectangles between cuts that hold nothing blocked and cannot grow.
fn free_rectangles(xs: &[i32], zs: &[i32], blocked: &[Rect]) -> Vec<Rect> {
    let mut free: Vec<Rect> = Vec::new();
    for (i, &left) in xs.iter().enumerate() {
        for &right in xs[i + 1..].iter().rev() {
            let mut bottom = 0;
            while bottom + 1 < zs.len() {
                let rect = |top: usize| Rect { min: [left, zs[bottom]], max: [right, zs[top]] };
                let is_free = |top: usize| blocked.iter().all(|other| !overlap(&rect(top), other));
                let top = (bottom + 1..zs.len()).take_while(|&top| is_free(top)).last();
                match top {
                    Some(top) => {
                        free.push(rect(top));
                        bottom = top;
                    }
                    None => bottom += 1,
                }
            }
        }
    }
    let inside = |a: &Rect, b: &Rect| (0..2).all(|axis| b.min[axis] <= a.min[axis] && a.max[axis] <= b.max[axis]);
    let all = free.clone();
    free.retain(|rect| {
        let thick = (0..2).all(|axis| rect.max[axis] - rect.min[axis] >= 40);
        thick && !all.iter().any(|other| other != rect && inside(rect, other))
    });
    free
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect(min: [i32; 2], max: [i32; 2]) -> Rect {
        Rect { min, max }
    }

    #[test]
    fn an_outline_without_obstacles_stays_whole() {
        let outline = rect([0, 0], [1000, 500]);
        assert_eq!(cover(outline, &[[10, 10]], &[rect([2000, 0], [2100, 100])]), [outline]);
    }

    #[test]
    fn a_corner_that_can_be_walked_on_leaves_an_l() {
        let points: Vec<[i32; 2]> = (0..40).map(|i| [i * 50, 100]).chain((0..40).map(|i| [100, i * 50])).collect();
        let parts = cover(rect([0, 0], [2000, 2000]), &points, &[rect([300, 300], [2000, 2000])]);
        assert_eq!(parts.len(), 2);
        assert!(points.iter().all(|p| parts.iter().any(|part| part.contains(p[0], p[1]))));
        assert!(parts.iter().all(|part| !part.contains(1000, 1000)));
    }
}
