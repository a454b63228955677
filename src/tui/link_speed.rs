//! How fast the link to the terminal is, by how long the terminal takes to take frames in.

use std::time::Duration;

/// What is known of the link.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LinkSpeed {
    /// The quickest answer: the way there and back.
    quickest: Option<Duration>,
    /// Where it is slow.
    bytes_per_second: Option<f64>,
}

/// A frame that takes no longer on top of the way says that the link is fast.
const QUICK: Duration = Duration::from_millis(60);
/// A smaller frame says nothing of the link.
const TELLING: u64 = 1000;
/// The share of a second that a picture may take: a key that is pressed meanwhile is answered behind it, and within a second.
const SHARE: f64 = 0.2;

impl LinkSpeed {
    /// The way there and back takes so long.
    pub(crate) fn is_so_far(&mut self, took: Duration) {
        self.quickest = Some(self.quickest.map_or(took, |quickest| quickest.min(took)));
    }

    /// A frame of so many bytes was taken in.
    pub(crate) fn observe(&mut self, bytes: u64, took: Duration) {
        self.is_so_far(took);
        if bytes < TELLING {
            return;
        }
        let over = took.saturating_sub(self.quickest.unwrap_or(took));
        self.bytes_per_second = match (over > QUICK, self.bytes_per_second) {
            (false, _) => None,
            (true, before) => {
                let measured = bytes as f64 / over.as_secs_f64();
                Some(before.map_or(measured, |before| (before + measured) / 2.0))
            }
        };
    }

    /// The most bytes that a picture may cost so that keys are answered in time; nothing where the link is fast.
    pub(crate) fn affords(&self) -> Option<u64> {
        self.bytes_per_second.map(|speed| (SHARE * speed) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_frame_tells_the_speed_where_the_way_was_measured_before_it() {
        let mut link = LinkSpeed::default();
        link.is_so_far(Duration::from_millis(200));
        link.observe(3000, Duration::from_millis(800));
        assert_eq!(link.affords(), Some(1000));
    }

    #[test]
    fn a_slow_link_is_known_by_large_frames_and_a_long_way_alone_is_none() {
        let mut link = LinkSpeed::default();
        let way = Duration::from_millis(400);
        let over = |bytes: u64, speed: f64| way + Duration::from_secs_f64(bytes as f64 / speed);
        link.observe(300, over(300, 1e7));
        link.observe(9000, over(9000, 1e7));
        assert_eq!(link.affords(), None, "far and fast");
        for bytes in [9000, 500, 4000] {
            link.observe(bytes, over(bytes, 5000.0));
        }
        let affords = link.affords().unwrap();
        assert!((960..=1080).contains(&affords), "{affords}");
        link.observe(9000, over(9000, 1e7));
        assert_eq!(link.affords(), None, "it got better");
    }
}
