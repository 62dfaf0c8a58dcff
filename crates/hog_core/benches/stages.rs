//! The stages one by one, 640 × 480, one thread: `cargo bench -p hog_core`.
//!
//! The exact path's stages are functions; the fast path's lie within a level, so there a level and a pyramid are timed,
//! on every backend this CPU has. For ratios to OpenCV see `limo-hog bench`.
#![allow(clippy::unwrap_used, reason = "a benchmark may fail")]
#![allow(missing_docs, reason = "criterion makes public functions")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hog_core::exact::RowVotes;
use hog_core::{
    Backend, Grouping, Hog, HogParams, ImageView, Interrupt, Search, SearchOptions, Size, model, pyramid,
};

const WIDTH: usize = 640;
const HEIGHT: usize = 480;
const SEARCH: Search = Search { hit_threshold: 0.0, win_stride: (8, 8), padding: (4, 4) };
const KINDS: [(&str, usize); 2] = [("gray", 1), ("colour", 3)];

/// Soft waves under a little noise: gradients in all directions, as in photographs.
fn picture(channels: usize) -> Vec<u8> {
    let mut noise = 1u32;
    let pixel = |index: usize| {
        let (x, y) = ((index / channels % WIDTH) as f32, (index / channels / WIDTH) as f32);
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let waves = (x / 23.0).sin() + (y / 17.0).cos() + ((x + y) / 31.0 + index as f32 % 3.0).sin();
        (128.0 + 40.0 * waves + (noise >> 29) as f32) as u8
    };
    (0..WIDTH * HEIGHT * channels).map(pixel).collect()
}

fn exact_path(criterion: &mut Criterion) {
    for (kind, channels) in KINDS {
        let data = picture(channels);
        let image = ImageView::new(&data, WIDTH, HEIGHT, channels, channels * WIDTH).unwrap();
        let hog = Hog::new(&HogParams::default(), None).unwrap();
        let mut out = vec![0.0; hog.compute_len(image, &SEARCH, None).unwrap()];
        let mut group = criterion.benchmark_group(format!("exact/{kind}"));
        group.throughput(Throughput::Elements((WIDTH * HEIGHT) as u64));
        let smaller = Size::new(WIDTH * 20 / 21, HEIGHT * 20 / 21);
        group.bench_function("resize", |b| b.iter(|| pyramid::resize(black_box(image), smaller)));
        let (mut shares, mut bins) = (vec![[0.0; 2]; WIDTH * HEIGHT], vec![[0; 2]; WIDTH * HEIGHT]);
        group.bench_function("gradient", |b| {
            b.iter(|| {
                let votes = RowVotes { shares: &mut shares, bins: &mut bins };
                hog.gradient(black_box(image), [0; 4], &Interrupt::NEVER, votes)
            })
        });
        group.bench_function("compute", |b| {
            b.iter(|| hog.compute(black_box(image), &SEARCH, None, &Interrupt::NEVER, &mut out))
        });
    }
}

fn fast_path(criterion: &mut Criterion) {
    for backend in Backend::ALL.into_iter().filter(|backend| backend.is_available()) {
        let hog = Hog::with_backend(&HogParams::default(), Some(model::default_people()), backend).unwrap();
        for (kind, channels) in KINDS {
            let data = picture(channels);
            let image = ImageView::new(&data, WIDTH, HEIGHT, channels, channels * WIDTH).unwrap();
            let mut group = criterion.benchmark_group(format!("{}/{kind}", backend.name()));
            group.throughput(Throughput::Elements((WIDTH * HEIGHT) as u64));
            group.bench_function("level", |b| {
                b.iter(|| hog.detect_windows(black_box(image), &SEARCH, None, &Interrupt::NEVER))
            });
            let grouping = Grouping::Similar(2);
            group.bench_function("pyramid", |b| {
                b.iter(|| {
                    hog.detect(
                        black_box(image),
                        &SearchOptions { search: SEARCH, scale: 1.05, grouping, ..SearchOptions::default() },
                        &Interrupt::NEVER,
                    )
                });
            });
        }
    }
}

criterion_group! {
    name = stages;
    config = Criterion::default().sample_size(20).without_plots();
    targets = exact_path, fast_path
}
criterion_main!(stages);
