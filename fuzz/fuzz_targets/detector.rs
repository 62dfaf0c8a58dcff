//! Geometry × image × search: refused with an error, or every backend finds the windows that the exact path finds.
#![no_main]

use arbitrary::Arbitrary;
use hog_core::exact::{self, Svm, Tables};
use hog_core::pyramid::Steps;
use hog_core::{Backend, Grouping, Hog, HogParams, ImageView, Interrupt, Search};
use libfuzzer_sys::fuzz_target;

#[derive(Arbitrary, Debug)]
struct Case {
    /// Of 8: the geometries that the kernels serve, any small one, or any at all.
    kind: u8,
    blocks: (u8, u8),
    win: (i32, i32),
    block: (i16, i16),
    stride: (i16, i16),
    cell: (i16, i16),
    nbins: u8,
    sigma: f32,
    clip: f32,
    flags: u8,
    nlevels: i16,
    size: (u8, u8),
    win_stride: (i8, i8),
    padding: (i8, i8),
    far: u8,
    scale: u8,
    group: i8,
    share: u8,
    seed: u32,
    pixels: Vec<u8>,
}

fn small((x, y): (i16, i16), most: i16) -> (i64, i64) {
    (i64::from(x.rem_euclid(most)) + 1, i64::from(y.rem_euclid(most)) + 1)
}

impl Case {
    fn params(&self) -> HogParams {
        let flag = |bit: u8| self.flags & (1 << bit) != 0;
        let mut params = HogParams {
            win_sigma: f64::from(self.sigma),
            l2_hys_threshold: f64::from(self.clip),
            gamma_correction: flag(0),
            nlevels: i64::from(self.nlevels),
            signed_gradient: flag(1),
            ..HogParams::default()
        };
        let blocks = |of: u8| i64::from(of % 4);
        match self.kind % 8 {
            0..=3 => params.win_size = (16 + 8 * blocks(self.blocks.0), 16 + 8 * blocks(self.blocks.1)),
            4..=6 => {
                params.cell_size = small(self.cell, 9);
                let cells = small(self.block, 3);
                params.block_size = (params.cell_size.0 * cells.0, params.cell_size.1 * cells.1);
                params.block_stride = small(self.stride, 12);
                params.win_size = (
                    params.block_size.0 + params.block_stride.0 * blocks(self.blocks.0),
                    params.block_size.1 + params.block_stride.1 * blocks(self.blocks.1),
                );
                params.nbins = i64::from(self.nbins);
            }
            _ => {
                // Anything may be refused; what is not, is small enough to be worked on.
                let wide = |(x, y): (i16, i16)| (i64::from(x), i64::from(y));
                params.win_size = (i64::from(self.win.0), i64::from(self.win.1));
                params.block_size = wide(self.block);
                params.block_stride = wide(self.stride);
                params.cell_size = wide(self.cell);
                params.nbins = i64::from(self.nbins);
            }
        }
        if !flag(2) {
            (params.win_sigma, params.l2_hys_threshold, params.nlevels) = (-1.0, 0.2, 64);
        }
        params
    }
}

fuzz_target!(|case: Case| {
    let params = case.params();
    let Ok(spec) = hog_core::HogSpec::new(&params) else { return };
    if spec.block.area() > 4096 || spec.descriptor_len() > 20_000 {
        return;
    }
    let mut state = case.seed | 1;
    let mut noise = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 16
    };
    let coefficients: Vec<f32> =
        (0..spec.descriptor_len() + usize::from(case.flags & 8 != 0)).map(|_| (noise() % 512) as f32 / 2048.0 - 0.125).collect();
    let (width, height) = (usize::from(case.size.0 % 72) + 1, usize::from(case.size.1 % 72) + 1);
    let channels = if case.flags & 16 != 0 { 3 } else { 1 };
    let data: Vec<u8> = (0..width * height * channels)
        .map(|i| case.pixels.get(i % (case.pixels.len() + 1)).copied().unwrap_or_else(|| noise() as u8))
        .collect();
    let image = ImageView::new(&data, width, height, channels, width * channels).expect("it is an image");
    let far = if case.far == 0 { 1 << 13 } else { 1 };
    let all = Search {
        hit_threshold: -1e9,
        win_stride: (i64::from(case.win_stride.0) * far, i64::from(case.win_stride.1)),
        padding: (i64::from(case.padding.0 / 2), i64::from(case.padding.1 / 2)),
    };
    let Ok(steps) = Steps::new(all.win_stride, all.padding, spec.cell, &spec) else {
        let hog = Hog::new(&params, Some(&coefficients)).expect("the geometry fits");
        assert!(hog.detect(image, &all, None, &Interrupt::NEVER).is_err());
        return;
    };
    let grid = steps.grid(image.size(), &spec);
    if grid.len() * spec.descriptor_len() > 400_000 || grid.padded.area() > 60_000 {
        return;
    }
    let svm = Svm::new(&coefficients, &spec).expect("one coefficient an element");
    let tables = Tables::new(&spec).expect("it fits the memory");
    let scores = exact::scores(image, &grid, &spec, &tables, &svm, &Interrupt::NEVER).expect("it fits the memory");
    let mut sorted: Vec<f64> = scores.iter().copied().filter(|score| score.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    // The score of a window, so that a close call is decided.
    let hit_threshold = sorted.get(usize::from(case.share) * sorted.len() / 256).copied().unwrap_or(0.0);
    let wanted: Vec<(i64, i64)> = (0..scores.len())
        .filter(|&i| scores[i] >= hit_threshold)
        .map(|i| {
            let (column, row) = (i % grid.windows.width, i / grid.windows.width);
            grid.to_image(column * grid.stride.width, row * grid.stride.height)
        })
        .collect();
    let search = Search { hit_threshold, ..all };
    let scale = 1.0 + f64::from(case.scale) / 128.0;
    let grouping = if case.flags & 32 != 0 && hit_threshold > 0.0 && wanted.len() < 12 {
        Grouping::MeanShift(f64::from(case.group))
    } else {
        Grouping::Similar(i32::from(case.group))
    };
    let mut first = None;
    for backend in Backend::ALL.into_iter().filter(|backend| backend.is_available()) {
        let hog = Hog::with_backend(&params, Some(&coefficients), backend).expect("the geometry fits");
        let hits = hog.detect(image, &search, None, &Interrupt::NEVER).expect("it fits the memory");
        let found: Vec<(i64, i64)> = hits.iter().map(|hit| (hit.x, hit.y)).collect();
        assert_eq!(found, wanted, "{}: {params:?}, {search:?}, {:?}, scores {scores:?}", backend.name(), image.size());
        let found = hog.detect_multi_scale(image, &search, scale, grouping, 1, &Interrupt::NEVER);
        let rects: Vec<_> = found.expect("it fits the memory").into_iter().map(|(rect, _)| rect).collect();
        assert_eq!(*first.get_or_insert_with(|| rects.clone()), rects, "{}", backend.name());
    }
});
