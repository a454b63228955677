//! Seeds made of numbers: neighbours have nothing in common.

/// SplitMix64's finaliser over two numbers.
pub(crate) fn mix(a: u64, b: u64) -> u64 {
    let mut z = a.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ b.wrapping_mul(0xd1b5_4a32_d192_ed03);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_pair_of_small_numbers_has_a_seed_of_its_own() {
        let seeds: BTreeSet<u64> = (0..50).flat_map(|a| (0..50).map(move |b| mix(a, b))).collect();
        assert_eq!(seeds.len(), 2_500);
    }
}
