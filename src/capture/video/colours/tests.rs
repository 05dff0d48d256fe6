//! Colours against the closed forms of the standards.

use super::*;

fn tags(matrix: &str, range: &str, primaries: &str, transfer: &str) -> ColourTags {
    ColourTags {
        range: range.to_owned(),
        matrix: matrix.to_owned(),
        primaries: primaries.to_owned(),
        transfer: transfer.to_owned(),
    }
}

/// Luma and chroma of a colour from 0 to 1 by H.273, equations of table 4, as codes of a depth.
fn coded(rgb: [f64; 3], (kr, kb): (f64, f64), full: bool, bits: u32) -> [u16; 3] {
    let [r, g, b] = rgb;
    let y = kr * r + (1.0 - kr - kb) * g + kb * b;
    let (cb, cr) = ((b - y) / (2.0 * (1.0 - kb)), (r - y) / (2.0 * (1.0 - kr)));
    let unit = f64::from(1 << (bits - 8));
    let largest = f64::from((1 << bits) - 1);
    let [y, cb, cr] = if full {
        [
            y * largest,
            cb * largest + 128.0 * unit,
            cr * largest + 128.0 * unit,
        ]
    } else {
        [
            (16.0 + 219.0 * y) * unit,
            (128.0 + 224.0 * cb) * unit,
            (128.0 + 224.0 * cr) * unit,
        ]
    };
    [y, cb, cr].map(|code| code.round().clamp(0.0, largest) as u16)
}

/// A frame of one colour, in 8 bits or more.
fn flat(code: [u16; 3], layout: PixelLayout, size_px: [u32; 2], deep: bool) -> Vec<u8> {
    let area = (size_px[0] * size_px[1]) as usize;
    let samples = layout.bytes(size_px) / if deep { 2 } else { 1 };
    let chroma = (samples - area) / 2;
    let all = [(code[0], area), (code[1], chroma), (code[2], chroma)];
    all.iter()
        .flat_map(|&(code, count)| std::iter::repeat_n(code, count))
        .flat_map(|code| match deep {
            true => code.to_le_bytes().to_vec(),
            false => vec![code as u8],
        })
        .collect()
}

const COLOURS: [[u8; 3]; 6] = [
    [200, 60, 40],
    [20, 180, 90],
    [30, 40, 220],
    [128, 128, 128],
    [255, 255, 255],
    [0, 0, 0],
];

#[test]
fn every_matrix_range_and_depth_gives_its_colours() {
    let matrices = [
        ("smpte170m", (0.299, 0.114)),
        ("bt470bg", (0.299, 0.114)),
        ("bt709", (0.2126, 0.0722)),
        ("bt2020nc", (0.2627, 0.0593)),
    ];
    // Sides that are odd, too.
    for size_px in [[36, 8], [35, 7], [1, 1]] {
        for name in PixelLayout::ffmpeg_names().split('|') {
            let layout = PixelLayout::by_ffmpeg_name(name).unwrap();
            let bits = layout.largest().count_ones();
            if !matches!(layout, PixelLayout::Planar { .. }) {
                continue;
            }
            for (matrix, weights) in matrices {
                for (range, full) in [("tv", false), ("pc", true)] {
                    for rgb in COLOURS {
                        let unit = rgb.map(|channel| f64::from(channel) / 255.0);
                        let code = coded(unit, weights, full, bits);
                        let pixels = flat(code, layout, size_px, bits > 8);
                        let tags = tags(matrix, range, "bt709", "bt709");
                        let colours = Colours::of(&tags, layout, 480);
                        assert!(colours.is_srgb());
                        let rgba = planes::rgba8(&pixels, layout, size_px, colours.coding).unwrap();
                        assert_eq!(rgba.len(), (size_px[0] * size_px[1] * 4) as usize);
                        let allowed = if bits > 8 { 1 } else { 2 };
                        for pixel in rgba.chunks_exact(4) {
                            let worst = (0..3).map(|k| pixel[k].abs_diff(rgb[k])).max();
                            assert!(
                                worst <= Some(allowed),
                                "{name} {matrix} {range} {rgb:?}: {pixel:?}"
                            );
                            assert_eq!(pixel[3], 255);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn what_says_nothing_is_told_by_its_lines_and_its_format() {
    let layout = |name| PixelLayout::by_ffmpeg_name(name).unwrap();
    let of = |name, lines| {
        Colours::of(
            &tags("unknown", "unknown", "unknown", "unknown"),
            layout(name),
            lines,
        )
    };
    assert!(matches!(
        of("yuv420p", 576).coding.matrix,
        YuvStandardMatrix::Bt601
    ));
    assert!(matches!(
        of("yuv420p", 720).coding.matrix,
        YuvStandardMatrix::Bt709
    ));
    assert!(matches!(of("yuv420p", 576).coding.range, YuvRange::Limited));
    assert!(matches!(of("yuvj420p", 576).coding.range, YuvRange::Full));
    assert!(matches!(of("gray", 576).coding.range, YuvRange::Full));
    let tagged = Colours::of(
        &tags("smpte170m", "pc", "unknown", "unknown"),
        layout("yuv420p"),
        1080,
    );
    assert!(matches!(tagged.coding.matrix, YuvStandardMatrix::Bt601));
    assert!(matches!(tagged.coding.range, YuvRange::Full));
}

#[test]
fn primaries_are_those_of_h_273() {
    // BT.2087-0, section 4: from BT.2020 to BT.709.
    let expected = [
        [1.6605, -0.5876, -0.0728],
        [-0.1246, 1.1329, -0.0083],
        [-0.0182, -0.1006, 1.1187],
    ];
    let found = bt709_from(Primaries::Bt2020);
    for (row, expected) in expected.iter().enumerate() {
        for (column, expected) in expected.iter().enumerate() {
            let found = found.col(column)[row];
            assert!((found - expected).abs() < 2e-4, "{row} {column}: {found}");
        }
    }
    assert!(bt709_from(Primaries::Bt709).abs_diff_eq(DMat3::IDENTITY, 1e-12));
    let white = bt709_from(Primaries::P3) * DVec3::ONE;
    assert!(white.abs_diff_eq(DVec3::ONE, 1e-9));
}

fn srgb_from(primaries: &str, transfer: &str, coded: [u16; 3]) -> [u8; 3] {
    let layout = PixelLayout::by_ffmpeg_name("yuv420p10le").unwrap();
    let colours = Colours::of(&tags("bt2020nc", "tv", primaries, transfer), layout, 1080);
    assert!(!colours.is_srgb());
    let to_srgb = ToSrgb::new(colours, 1023);
    let rgba = to_srgb.rgba(&[coded[0], coded[1], coded[2], 1023]);
    [rgba[0], rgba[1], rgba[2]]
}

#[test]
fn other_primaries_keep_grey_and_turn_colours() {
    for grey in [0, 100, 512, 1023] {
        let expected = (f64::from(grey) * 255.0 / 1023.0).round() as u8;
        for channel in srgb_from("bt2020", "bt2020-10", [grey; 3]) {
            assert!(channel.abs_diff(expected) <= 1, "{grey}: {channel}");
        }
    }
    // BT.709's red in BT.2020's primaries (the inverse of the matrix above, by the display's curve).
    let red =
        [0.6274_f64, 0.0691, 0.0164].map(|light| (light.powf(1.0 / 2.4) * 1023.0).round() as u16);
    let [r, g, b] = srgb_from("bt2020", "bt2020-10", red);
    assert!(r >= 254 && g <= 12 && b <= 12, "{r} {g} {b}");
}

#[test]
fn pq_and_hlg_agree_with_the_standards_levels() {
    // BT.2408-4, table 1: white paper is 58 % of PQ and 75 % of HLG.
    assert!((pq_of_nits(203.0) - 0.58).abs() < 0.002);
    assert!((nits_of_pq(1.0) - 10_000.0).abs() < 1e-6);
    let scene = light_of(0.75, Transfer::Hlg) as f32;
    let shown = hlg_displayed(Vec3::splat(scene));
    assert!((shown.x - 1.0).abs() < 0.01, "{shown}");
    assert!((light_of(1.0, Transfer::Hlg) - 1.0).abs() < 1e-6);
}

#[test]
fn tone_mapping_keeps_the_dark_and_the_order_and_ends_at_white() {
    // Below the knee nothing changes.
    for light in [0.0, 0.01, 0.1, 0.4] {
        assert!((shown_of(light) - light).abs() < 1e-9, "{light}");
    }
    let mut last = -1.0;
    for k in 0..=500 {
        let shown = shown_of(f64::from(k) * 0.01);
        assert!(shown >= last - 1e-12 && shown <= 1.0 + 1e-9, "{k}: {shown}");
        last = shown;
    }
    assert!((shown_of(PEAK_NITS / WHITE_NITS) - 1.0).abs() < 1e-9);
    let code = |share: f64| (share * 1023.0).round() as u16;
    for (transfer, white, dark_nits, dark) in [
        ("smpte2084", 0.58, 20.0, pq_of_nits(20.0)),
        ("arib-std-b67", 0.75, 0.0, 0.0),
    ] {
        let [white, green, blue] = srgb_from("bt2020", transfer, [code(white); 3]);
        assert!((215..=240).contains(&white), "{transfer}: paper is {white}");
        assert!(
            green.abs_diff(white) <= 1 && blue.abs_diff(white) <= 1,
            "paper is grey"
        );
        assert_eq!(srgb_from("bt2020", transfer, [1023; 3]), [255; 3]);
        let expected = (srgb_of(dark_nits / WHITE_NITS) * 255.0).round() as u8;
        let found = srgb_from("bt2020", transfer, [code(dark); 3])[0];
        assert!(
            found.abs_diff(expected) <= 1,
            "{transfer}: {found}, {expected}"
        );
    }
}
