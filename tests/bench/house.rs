//! House on one core: frames per second, steps per second, and resets. `cargo bench --bench house`

mod baseline;

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput, criterion_group};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sprint_explorer::domain::world::Instance;
use sprint_explorer::domain::{Action, ActionType, Heading, Room, Scene, World};
use sprint_explorer::house::render::Renderer;
use sprint_explorer::house::view::View;
use sprint_explorer::house::{House, generate, rules};

use baseline::CriterionBaselines;

/// Houses of all kinds.
fn houses() -> Vec<(Scene, World)> {
    Room::ALL.into_iter().flat_map(|room| (0..4).map(move |seed| generate::house(room, seed))).collect()
}

/// Worlds that differ in where the agent stands and looks.
fn poses(scene: &Scene, world: &World, count: usize, rng: &mut ChaCha8Rng) -> Vec<World> {
    let mut pose = || {
        let mut world = world.clone();
        world.agent.cell = scene.cells[rng.random_range(0..scene.cells.len())];
        world.agent.heading = Heading::from_quarters(rng.random_range(0..4));
        world.agent.horizon = [0, 15, 30, 30, 45][rng.random_range(0..5)];
        world
    };
    (0..count).map(|_| pose()).collect()
}

/// Any action on anything.
fn random_action(world: &World, rng: &mut ChaCha8Rng) -> Action {
    let kind = ActionType::ALL[rng.random_range(0..ActionType::COUNT)];
    if !kind.is_interaction() {
        return Action::navigate(kind);
    }
    let fixtures = world.fixtures.len();
    let target = match rng.random_range(0..fixtures + world.objects.len()) {
        index if index < fixtures => Instance::Fixture(index as u16),
        index => Instance::Object((index - fixtures) as u16),
    };
    Action::interact(kind, target)
}

fn frames(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frames");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let stages: Vec<(Scene, Vec<World>)> = houses()
        .into_iter()
        .map(|(scene, world)| {
            let worlds = poses(&scene, &world, 16, &mut rng);
            (scene, worlds)
        })
        .collect();
    group.throughput(Throughput::Elements(stages.iter().map(|(_, worlds)| worlds.len() as u64).sum()));
    let mut renderers: Vec<Renderer> = stages.iter().map(|_| Renderer::new(House::FRAME)).collect();
    group.bench_function("draw", |bencher| {
        bencher.iter(|| {
            for ((scene, worlds), renderer) in stages.iter().zip(&mut renderers) {
                for world in worlds {
                    black_box(renderer.draw(scene, world));
                }
            }
        });
    });
    group.bench_function("draw and view", |bencher| {
        bencher.iter(|| {
            for ((scene, worlds), renderer) in stages.iter().zip(&mut renderers) {
                for world in worlds {
                    black_box(View::of(renderer.draw(scene, world)));
                }
            }
        });
    });
    group.finish();
}

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("steps");
    const STEPS: usize = 1000;
    group.throughput(Throughput::Elements(STEPS as u64));
    let (scene, world) = generate::house(Room::Kitchen, 0);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    group.bench_function("random, not drawn", |bencher| {
        bencher.iter_batched(
            || world.clone(),
            |mut world| {
                for _ in 0..STEPS {
                    let action = random_action(&world, &mut rng);
                    black_box(rules::apply(&scene, &mut world, action));
                }
                world
            },
            BatchSize::SmallInput,
        );
    });
    // What `sprint serve` does for a step, without telling anybody: compare `assets/python/bench_house.py`.
    let moves: Vec<Action> = (0..STEPS).map(|_| Action::navigate(ActionType::ALL[rng.random_range(0..5)])).collect();
    let mut house = House::new(Arc::new(scene), world.clone());
    for size in [128, House::FRAME] {
        let mut renderer = Renderer::new(size);
        group.bench_function(format!("moves, drawn at {size} pixels"), |bencher| {
            bencher.iter(|| {
                house.restore(world.clone());
                for &action in &moves {
                    house.step(action);
                    black_box(renderer.draw(house.scene(), house.world()));
                }
            });
        });
    }
    group.finish();
}

fn resets(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("resets");
    let (scene, world) = generate::house(Room::Kitchen, 0);
    let scene = Arc::new(scene);
    let mut house = House::new(scene.clone(), world.clone());
    group.bench_function("restore", |bencher| bencher.iter(|| house.restore(black_box(&world).clone())));
    group.bench_function("new house", |bencher| {
        bencher.iter(|| House::new(black_box(&scene).clone(), black_box(&world).clone()));
    });
    group.finish();
}

criterion_group!(benches, frames, steps, resets);

fn main() -> anyhow::Result<()> {
    let mut baselines = CriterionBaselines::open()?;
    benches();
    Criterion::default().configure_from_args().final_summary();
    baselines.compare_criterion(&[
        "frames/draw",
        "frames/draw and view",
        "steps/random, not drawn",
        "steps/moves, drawn at 128 pixels",
        "steps/moves, drawn at 300 pixels",
        "resets/restore",
        "resets/new house",
    ])
}
