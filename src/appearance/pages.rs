//! Rectangles on pages: each where its upper side is highest above what lies there, the leftmost of such places (skyline packing).

/// The upper edge of what is free on a page: where each step begins, and its height; from the left to the right.
type Skyline = Vec<[u32; 2]>;
/// A page and an upper left corner on it.
type Spot = (usize, [u32; 2]);

/// Puts rectangles (texels) in the given order on pages of a width and at most a height. Returns the page and the upper left corner
/// of each, and the sizes of the pages as far as they are used. A rectangle that is larger than a page gets one of its size.
pub(super) fn place(sizes: &[[u32; 2]], width: u32, highest: u32) -> (Vec<Spot>, Vec<[u32; 2]>) {
    let mut lines: Vec<Skyline> = Vec::new();
    let mut pages: Vec<[u32; 2]> = Vec::new();
    let mut places = Vec::with_capacity(sizes.len());
    for &[w, h] in sizes {
        let free = |line: &Skyline| lowest(line, w, width).filter(|at| at[1] + h <= highest);
        let found = lines.iter().enumerate().find_map(|(page, line)| Some((page, free(line)?)));
        let (page, at) = found.unwrap_or_else(|| {
            lines.push(vec![[0, 0]]);
            pages.push([0, 0]);
            (lines.len() - 1, [0, 0])
        });
        if let (Some(line), Some(size)) = (lines.get_mut(page), pages.get_mut(page)) {
            lower(line, at[0], at[0] + w, at[1] + h);
            *size = [size[0].max(at[0] + w), size[1].max(at[1] + h)];
        }
        places.push((page, at));
    }
    (places, pages)
}

/// The place for a width whose upper side is highest; `None` where the page is not so wide.
fn lowest(line: &[[u32; 2]], w: u32, width: u32) -> Option<[u32; 2]> {
    let mut best: Option<[u32; 2]> = None;
    for (i, &[x, _]) in line.iter().enumerate().take_while(|(_, step)| step[0] + w <= width) {
        let y = line[i..].iter().take_while(|step| step[0] < x + w).map(|step| step[1]).max().unwrap_or(0);
        if best.is_none_or(|[_, least]| y < least) {
            best = Some([x, y]);
        }
    }
    best
}

/// Takes all above `y` from one column to another.
fn lower(line: &mut Skyline, from: u32, to: u32, y: u32) {
    // What goes on behind it.
    let behind = line.iter().rev().find(|step| step[0] <= to).map_or(0, |step| step[1]);
    line.retain(|step| step[0] < from || step[0] > to);
    let at = line.partition_point(|step| step[0] < from);
    line.insert(at, [from, y]);
    line.insert(at + 1, [to, behind]);
    line.dedup_by(|next, step| next[1] == step[1]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_fill_gaps_and_lie_on_no_other() {
        let sizes = [[6, 5], [4, 3], [4, 2], [3, 2], [7, 2], [2, 1], [1, 1]];
        let (places, pages) = place(&sizes, 10, 8);
        assert_eq!(places[..3], [(0, [0, 0]), (0, [6, 0]), (0, [6, 3])]);
        assert_eq!((places[3], places[4]), ((0, [0, 5]), (0, [3, 5])));
        assert_eq!(pages, [[10, 8]]);
        let covered: u32 = sizes.iter().map(|[w, h]| w * h).sum();
        let mut taken = std::collections::BTreeSet::new();
        for ([w, h], (page, [x, y])) in sizes.iter().zip(&places) {
            taken.extend((0..w * h).map(|i| (*page, x + i % w, y + i / w)));
        }
        assert_eq!(taken.len() as u32, covered);
        assert!(taken.iter().all(|(_, x, y)| *x < 10 && *y < 8));
    }

    #[test]
    fn what_does_not_fit_begins_another_page() {
        let (places, pages) = place(&[[8, 8], [5, 5], [3, 3], [12, 1]], 8, 8);
        assert_eq!(places, [(0, [0, 0]), (1, [0, 0]), (1, [5, 0]), (2, [0, 0])]);
        assert_eq!(pages, [[8, 8], [8, 5], [12, 1]]);
    }
}
