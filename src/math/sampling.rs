//! Some of many: evenly spread, every n-th, far from each other.

/// At most `count` members of a list, evenly spread, both ends among them; of a single one the first.
#[must_use]
pub fn evenly<T: Copy>(list: &[T], count: usize) -> Vec<T> {
    if list.len() <= count || count < 2 {
        return list.iter().copied().take(count).collect();
    }
    (0..count).filter_map(|i| list.get(i * (list.len() - 1) / (count - 1)).copied()).collect()
}

/// The step with which at most `most` of `count` are taken; at least 1.
#[must_use]
pub fn stride(count: usize, most: usize) -> usize {
    count.div_ceil(most.max(1)).max(1)
}

/// Farthest-point sampling: up to `most` of `count` things from `start` on, each the farthest from all before it, the first of
/// equals. Ascending; none where `start` is none of them.
#[must_use]
pub fn farthest(count: usize, start: usize, most: usize, apart: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let mut distance = vec![f64::INFINITY; count];
    let mut chosen = Vec::new();
    let mut next = (start < count && most > 0).then_some(start);
    while let Some(i) = next {
        chosen.push(i);
        if chosen.len() >= most.min(count) {
            break;
        }
        for (j, d) in distance.iter_mut().enumerate() {
            *d = if i == j { f64::NEG_INFINITY } else { d.min(apart(i, j)) };
        }
        next = (0..count)
            .filter(|&j| distance[j] > f64::NEG_INFINITY)
            .max_by(|&a, &b| distance[a].total_cmp(&distance[b]).then(b.cmp(&a)));
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_thinned_with_both_ends() {
        let list: Vec<usize> = (10..21).collect();
        assert_eq!(evenly(&list, 3), [10, 15, 20]);
        assert_eq!(evenly(&list, 1), [10]);
        assert_eq!(evenly(&list, 99), list);
        assert_eq!(evenly(&[9, 8, 7, 6, 5, 4, 3, 2, 1], 3), [9, 5, 1]);
        assert_eq!(evenly(&[4, 3], 5), [4, 3]);
        let list: Vec<usize> = (10..50).collect();
        assert_eq!(evenly(&list, 4), [10, 23, 36, 49]);
        assert!(evenly(&list, 0).is_empty() && evenly::<usize>(&[], 3).is_empty());
    }

    #[test]
    fn strides_leave_no_more_than_asked_for() {
        for (count, most) in [(0, 3), (3, 3), (4, 3), (100, 7)] {
            assert!((0..count).step_by(stride(count, most)).count() <= most);
        }
        assert_eq!([stride(4, 3), stride(0, 3)], [2, 1]);
    }

    #[test]
    fn the_farthest_comes_next_and_the_first_of_equals() {
        let places = [0.0f64, 1.0, 2.0, 10.0, -10.0];
        let apart = |i: usize, j: usize| (places[i] - places[j]).abs();
        assert_eq!(farthest(5, 0, 2, apart), [0, 3]);
        assert_eq!(farthest(5, 0, 3, apart), [0, 3, 4]);
        assert_eq!(farthest(5, 2, 9, apart), [0, 1, 2, 3, 4]);
        assert!(farthest(0, 0, 3, apart).is_empty());
    }
}
