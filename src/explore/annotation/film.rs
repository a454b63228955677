//! What was done in a span, as states that can be drawn: all of them as a film, or the ends of its steps as a strip.

use std::sync::Arc;

use anyhow::Context;

use super::spans::AnnotationSpan;
use crate::domain::{Scene, World};
use crate::episode::scenes::Scenes;
use crate::house::House;
use crate::house::replay::Replay;
use crate::house::validate;
use crate::house::view::Frame;

/// The states of a span.
#[derive(Debug)]
pub(crate) struct Film {
    pub(crate) scene: Arc<Scene>,
    /// The state before the span, and after each of its actions.
    pub(crate) shots: Vec<FilmShot>,
    /// The shot in which each step is done.
    ends: Vec<usize>,
}

/// A state of a film.
#[derive(Debug)]
pub(crate) struct FilmShot {
    pub(crate) world: World,
    /// What was done to get here; nothing at the start.
    pub(crate) did: String,
}

impl Film {
    /// Takes the demonstrated actions again by the rules alone.
    ///
    /// # Errors
    /// When the scene is absent or the demonstration does not fit it.
    pub(crate) fn of(span: &AnnotationSpan, scenes: &Scenes) -> anyhow::Result<Film> {
        let trajectory = &span.trajectory;
        let (scene, _) = scenes.scene(&trajectory.scene)?;
        validate::world(&scene, &trajectory.start).context("start")?;
        let skills = span.skills();
        let from = trajectory.skill_range(skills.start).start;
        let ends: Vec<usize> = skills.map(|skill| trajectory.skill_range(skill).end - from).collect();
        let until = from + ends.last().copied().unwrap_or(0);
        let actions = trajectory.actions.get(..until).context("skill_starts: beyond the actions")?;
        let mut replay = Replay::new(&scene, trajectory.start.clone(), actions);
        for _ in 0..from {
            replay.step();
        }
        let mut shots = vec![FilmShot { world: replay.world().clone(), did: String::new() }];
        while let Some(action) = replay.upcoming() {
            let class = action.target.and_then(|target| replay.world().class_of(&scene, target));
            let did = class.map_or(action.kind.to_string(), |class| format!("{} {}", action.kind, class.spoken()));
            replay.step();
            shots.push(FilmShot { world: replay.world().clone(), did });
        }
        Ok(Film { scene, shots, ends })
    }

    /// The position of the last shot.
    pub(crate) fn last(&self) -> usize {
        self.shots.len() - 1
    }

    /// The step that is under way at a shot, from 0; the last one at the end.
    pub(crate) fn step_at(&self, shot: usize) -> usize {
        self.ends.partition_point(|&end| end <= shot).min(self.ends.len().saturating_sub(1))
    }

    /// The shot in which the step after, or before, that of a shot begins.
    pub(crate) fn step_from(&self, shot: usize, forward: bool) -> usize {
        let mut starts = std::iter::once(0).chain(self.ends.iter().copied());
        match forward {
            true => starts.find(|&start| start > shot).unwrap_or(self.last()),
            false => starts.take_while(|&start| start < shot).last().unwrap_or(0),
        }
    }

    /// The start, and the end of each step.
    pub(crate) fn strip(&self) -> Vec<usize> {
        std::iter::once(0).chain(self.ends.iter().copied()).collect()
    }

    /// Something to draw its shots with.
    pub(crate) fn camera(&self) -> FilmCamera {
        FilmCamera(House::new(self.scene.clone(), World::default()))
    }
}

/// Draws the shots of a film.
pub(crate) struct FilmCamera(House);

impl FilmCamera {
    /// What the agent saw.
    pub(crate) fn draw(&mut self, shot: &FilmShot) -> Frame {
        self.0.restore(shot.world.clone());
        self.0.frame().clone()
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;

    #[test]
    fn a_film_begins_where_the_steps_before_led_and_knows_its_steps() {
        let folder = testing::dataset(&["a"], &[]);
        let scenes = Scenes::in_folder(Some(folder.path().join("scenes")));
        let spans = testing::spans(folder.path());
        let of =
            |skills: [u8; 2]| Film::of(spans.iter().find(|span| span.key.skills == skills).unwrap(), &scenes).unwrap();
        let (whole, rest) = (of([0, 3]), of([1, 3]));
        assert_eq!((whole.shots.len(), whole.strip()), (7, vec![0, 2, 4, 6]));
        assert_eq!((rest.shots.len(), rest.strip()), (5, vec![0, 2, 4]));
        assert_eq!(rest.shots[0].world, whole.shots[2].world);
        assert_eq!([0, 1, 2, 3, 4].map(|shot| rest.step_at(shot)), [0, 0, 1, 1, 1]);
        assert_eq!([0, 1, 2, 3, 4].map(|shot| rest.step_from(shot, true)), [2, 2, 4, 4, 4]);
        assert_eq!([0, 1, 2, 3, 4].map(|shot| rest.step_from(shot, false)), [0, 0, 0, 2, 2]);
        assert_eq!(rest.shots[1].did, "RotateLeft");
        assert_ne!(rest.camera().draw(&rest.shots[0]).rgb, rest.camera().draw(&rest.shots[1]).rgb);
    }
}
