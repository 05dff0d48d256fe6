//! Videos as phones, editors and grabbers write them, made by ffmpeg, and held against what ffprobe and ffmpeg say of them.

use std::path::Path;
use std::process::Command;

use crate::capture::{Frame, FrameSource, Notice};

/// Runs ffmpeg in a folder.
fn ffmpeg(folder: &Path, arguments: &str) {
    let status = Command::new("ffmpeg")
        .current_dir(folder)
        .args(["-y", "-v", "error", "-nostdin"])
        .args(arguments.split_whitespace())
        .status()
        .unwrap();
    assert!(status.success(), "{arguments}");
}

/// The frames' time stamps relative to the first, as ffprobe tells them; AVI has none for some reordered frames.
fn probed_secs(path: &Path) -> Vec<Option<f64>> {
    let secs = probed(path, "best_effort_timestamp_time");
    let first = secs[0].unwrap();
    secs.iter().map(|time| Some((*time)? - first)).collect()
}

/// What ffprobe tells of each frame; `None` where it does not know.
fn probed(path: &Path, entry: &str) -> Vec<Option<f64>> {
    let words = probed_words(path, &format!("frame={entry}"));
    words.iter().map(|word| word.parse().ok()).collect()
}

/// The first word of each line that ffprobe prints of an entry, where there is one.
fn probed_words(path: &Path, entry: &str) -> Vec<String> {
    let output = Command::new("ffprobe")
        .args(["-v", "error", "-select_streams", "v:0", "-show_entries"])
        .args([entry, "-of", "csv=p=0"])
        .arg(path)
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines()
        .filter_map(|line| line.split(',').next())
        .filter(|word| !word.is_empty())
        .map(str::to_owned)
        .collect()
}

fn all(path: &Path) -> (Vec<Frame>, Vec<Notice>) {
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        frames.push(frame);
    }
    (frames, source.notices().to_vec())
}

const SOURCE: &str = "-f lavfi -i testsrc2=size=128x96:rate=30:duration=4";

#[test]
fn every_frame_comes_with_its_own_time_and_nothing_whole_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let make = |arguments: &str| ffmpeg(folder, arguments);
    make(&format!(
        "{SOURCE} -vf select=not(between(t\\,1\\,2.5))+not(mod(n\\,3)) -fps_mode vfr vfr.mp4"
    ));
    make("-i vfr.mp4 -c copy vfr.mkv");
    make(&format!("{SOURCE} -g 30 whole.mp4"));
    make("-ss 1.2 -i whole.mp4 -c copy trimmed.mp4");
    make("-i whole.mp4 -c copy -output_ts_offset 1.4 starts_late.mkv");
    make("-i whole.mp4 -c copy -output_ts_offset 3.7 starts_late.mp4");
    make(&format!(
        "{SOURCE} -frames:v 60 -c:v libx264 -bf 3 b_frames.mp4"
    ));
    make("-i b_frames.mp4 -c copy b_frames.avi");
    make("-i b_frames.mp4 -c copy b_frames.ts");
    make("-i whole.mp4 -f lavfi -i sine=d=12 -c:v copy -c:a aac longer_sound.mkv");
    make(&format!("{SOURCE} -c:v mpeg4 -bf 2 mpeg4.avi"));
    make(&format!("{SOURCE} -c:v mjpeg mjpeg.avi"));
    make(&format!(
        "{SOURCE} -r 30000/1001 -c:v libvpx -auto-alt-ref 1 -b:v 200k vp8.webm"
    ));
    make(&format!("{SOURCE} -c:v mpeg2video mpeg2.mpg"));
    for name in [
        "vfr.mp4",
        "vfr.mkv",
        "whole.mp4",
        "trimmed.mp4",
        "starts_late.mkv",
        "starts_late.mp4",
        "b_frames.mp4",
        "b_frames.avi",
        "b_frames.ts",
        "longer_sound.mkv",
        "mpeg4.avi",
        "mjpeg.avi",
        "vp8.webm",
        "mpeg2.mpg",
    ] {
        let path = folder.join(name);
        let (frames, notices) = all(&path);
        let expected = probed_secs(&path);
        assert_eq!(notices, [], "{name}");
        assert_eq!(frames.len(), expected.len(), "{name}");
        for (k, (frame, expected)) in frames.iter().zip(&expected).enumerate() {
            assert_eq!(frame.index as usize, k, "{name}");
            let found = frame.time_secs;
            let agrees = expected.is_none_or(|expected| (found - expected).abs() < 2e-6);
            assert!(agrees, "{name} {k}: {found} {expected:?}");
        }
    }
}

#[test]
fn what_ffmpeg_does_not_miss_is_told_by_the_files_end() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.y4m", "a.gif", "a.ogv"] {
        ffmpeg(
            folder.path(),
            &format!("-f lavfi -i testsrc2=size=160x120:rate=25 -frames:v 20 {name}"),
        );
        let path = folder.path().join(name);
        let (whole, notices) = all(&path);
        assert_eq!((whole.len(), notices), (20, Vec::new()), "{name}");
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() * 6 / 10]).unwrap();
        let (frames, notices) = all(&path);
        assert!(frames.len() < 20 && !notices.is_empty(), "{name}");
    }
}

#[test]
fn a_frame_of_another_size_is_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (size, name) in [("128x96", "a.ts"), ("160x128", "b.ts")] {
        ffmpeg(
            folder,
            &format!("-f lavfi -i testsrc2=size={size}:rate=30 -frames:v 5 -f mpegts {name}"),
        );
    }
    // Their stamps follow each other; b's frames come between two parts of a.
    let parts = ["a.ts", "b.ts", "a.ts"].map(|name| std::fs::read(folder.join(name)).unwrap());
    let path = folder.join("mixed.ts");
    std::fs::write(&path, parts.concat()).unwrap();
    let (frames, notices) = all(&path);
    // The seam costs frames: those that are left are ffprobe's to tell.
    let widths = probed(&path, "width");
    let odd = notices.iter().filter(|notice| {
        matches!(
            notice,
            Notice::OtherSize {
                size_px: [160, 128],
                expected_px: [128, 96],
                ..
            }
        )
    });
    let count = |width: f64| widths.iter().filter(|found| **found == Some(width)).count();
    assert!(count(160.0) >= 4 && count(128.0) >= 8, "{widths:?}");
    assert_eq!(odd.count(), count(160.0), "{notices:?}");
    assert_eq!(frames.len(), count(128.0));
    let (alone, _) = all(&folder.join("a.ts"));
    for frame in &frames {
        assert!(
            alone.iter().any(|alone| alone.rgba == frame.rgba),
            "frame {}",
            frame.index
        );
    }
    assert!(
        frames
            .windows(2)
            .all(|pair| pair[0].time_secs < pair[1].time_secs)
    );
}

#[test]
fn a_phones_turned_video_is_held_upright() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    ffmpeg(
        folder,
        &format!("{SOURCE} -vf gblur=sigma=4 -frames:v 3 -c:v libx264 -pix_fmt yuv420p flat.mp4"),
    );
    for degrees in [90, 180, 270] {
        ffmpeg(
            folder,
            &format!("-i flat.mp4 -c copy -metadata:s:v rotate={degrees} turned.mp4"),
        );
        ffmpeg(folder, "-i turned.mp4 -frames:v 1 shown.png");
        let shown = image::open(folder.join("shown.png")).unwrap().to_rgba8();
        let (turned, notices) = all(&folder.join("turned.mp4"));
        assert_eq!(notices, []);
        assert_eq!(turned[0].size_px, <[u32; 2]>::from(shown.dimensions()));
        let off: u64 = turned[0]
            .rgba
            .iter()
            .zip(shown.as_raw())
            .map(|(a, b)| u64::from(a.abs_diff(*b)))
            .sum();
        let mean = off as f64 / shown.len() as f64;
        assert!(mean < 2.0, "{degrees}: {mean} levels off on the average");
    }
}

/// Bars of known colours through each coding.
#[test]
fn colours_are_those_that_the_stream_says() {
    let colours: [[u8; 3]; 6] = [
        [200, 60, 40],
        [40, 180, 60],
        [30, 50, 210],
        [128; 3],
        [240, 230, 40],
        [90, 20, 120],
    ];
    let bars = |size: [u32; 2]| {
        image::RgbImage::from_fn(size[0], size[1], |x, _| {
            image::Rgb(colours[(x * 6 / size[0]) as usize])
        })
    };
    let untagged = "colorspace=unknown:color_primaries=unknown:color_trc=unknown";
    let codings = [
        (
            "bt601.mp4",
            "smpte170m",
            "tv",
            "colorspace=smpte170m:color_primaries=smpte170m:color_trc=smpte170m",
            [192, 64],
        ),
        (
            "bt709.mp4",
            "bt709",
            "tv",
            "colorspace=bt709:color_primaries=bt709:color_trc=bt709",
            [192, 64],
        ),
        (
            "full.mp4",
            "bt709",
            "pc",
            "range=pc:colorspace=bt709:color_primaries=bt709:color_trc=bt709",
            [192, 64],
        ),
        ("small_untagged.mkv", "smpte170m", "tv", untagged, [192, 64]),
        ("large_untagged.mkv", "bt709", "tv", untagged, [192, 720]),
        (
            "bt2020_matrix.mp4",
            "bt2020",
            "tv",
            "colorspace=bt2020nc:color_primaries=bt709:color_trc=bt709",
            [192, 64],
        ),
    ];
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, matrix, range, tags, size) in codings {
        bars(size).save(folder.join("bars.png")).unwrap();
        for pixels in ["yuv420p", "yuv444p", "yuv422p10le"] {
            ffmpeg(
                folder,
                &format!(
                    "-loop 1 -i bars.png -frames:v 2 -vf scale=out_color_matrix={matrix}:out_range={range}:flags=accurate_rnd+full_chroma_int,format={pixels},setparams={tags} \
                 -c:v libx264 -qp 1 {name}"
                ),
            );
            let (frames, notices) = all(&folder.join(name));
            assert_eq!(notices, []);
            for (bar, colour) in colours.iter().enumerate() {
                let place = ((size[1] / 2 * size[0] + 16 + bar as u32 * 32) * 4) as usize;
                let found = &frames[1].rgba[place..place + 3];
                let worst = (0..3).map(|k| found[k].abs_diff(colour[k])).max();
                assert!(worst <= Some(2), "{name} {pixels}: {found:?}, {colour:?}");
            }
        }
    }
}

#[test]
fn hlg_is_tone_mapped_with_a_word() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hlg.mkv");
    ffmpeg(
        folder.path(),
        &format!(
            "{SOURCE} -frames:v 2 -vf format=yuv420p10le,setparams=colorspace=bt2020nc:color_primaries=bt2020:color_trc=arib-std-b67 -c:v ffv1 hlg.mkv"
        ),
    );
    let source = FrameSource::open(path.to_str().unwrap()).unwrap();
    let remark = source.remark().unwrap();
    assert!(
        remark.contains("hlg.mkv: HLG") && remark.contains("tone-mapped"),
        "{remark}"
    );
    ffmpeg(folder.path(), &format!("{SOURCE} -frames:v 2 plain.mp4"));
    let plain = folder.path().join("plain.mp4");
    assert_eq!(
        FrameSource::open(plain.to_str().unwrap()).unwrap().remark(),
        None
    );
}

#[test]
fn a_playlist_reaches_for_nothing_else_than_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mp4");
    std::fs::write(
        &path,
        "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nhttp://127.0.0.1:1/a.ts\n",
    )
    .unwrap();
    assert!(FrameSource::open(path.to_str().unwrap()).is_err());
    let text = folder.path().join("notes.txt");
    std::fs::write(&text, "not a video\n").unwrap();
    let said = FrameSource::open(text.to_str().unwrap())
        .err()
        .unwrap()
        .to_string();
    assert!(
        said.contains("notes.txt: cannot be opened as a video"),
        "{said}"
    );
}

/// A cover picture is another stream: what is wrong with it is no damage of the video's.
#[test]
fn what_lies_beside_the_video_does_not_damage_it() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    ffmpeg(
        folder.path(),
        "-f lavfi -i testsrc2=size=128x96:rate=30:duration=0.5 -f lavfi -i color=red:s=64x64:d=0.04 -map 0 -map 1 -c:v:0 \
         libx264 -pix_fmt yuv420p -c:v:1 mjpeg -disposition:v:1 attached_pic cover.mp4",
    );
    // Cut off in the cover's own data, as ffprobe sees it in none of the video's packets.
    let mut bytes = std::fs::read(inside("cover.mp4")).unwrap();
    let jpeg_end = bytes.windows(2).rposition(|pair| pair == [0xff, 0xd9]);
    if let Some(end) = jpeg_end {
        bytes[end..end + 2].fill(0);
    }
    std::fs::write(inside("cover.mp4"), bytes).unwrap();
    let (frames, notices) = all(&inside("cover.mp4"));
    assert_eq!((frames.len(), notices.len()), (15, 0), "{notices:?}");
    ffmpeg(folder.path(), "-f lavfi -i sine=d=0.2 sound.m4a");
    let sound = FrameSource::open(inside("sound.m4a").to_str().unwrap());
    let message = sound.err().unwrap().to_string();
    assert!(message.contains("sound.m4a: holds no video"), "{message}");
}

#[test]
fn fields_and_oblong_pixels_are_told() {
    let folder = tempfile::tempdir().unwrap();
    ffmpeg(
        folder.path(),
        &format!("{SOURCE} -frames:v 4 -vf setsar=4/3 -c:v libx264 -pix_fmt yuv420p wide.mp4"),
    );
    ffmpeg(
        folder.path(),
        &format!(
            "{SOURCE} -frames:v 8 -vf tinterlace=interleave_top -c:v mpeg2video -flags +ilme+ildct fields.mpg"
        ),
    );
    for (name, part) in [
        ("wide.mp4", "1.333 times as wide as high"),
        ("fields.mpg", "it is interlaced"),
    ] {
        let source = FrameSource::open(folder.path().join(name).to_str().unwrap()).unwrap();
        let remark = source.remark().unwrap_or_default();
        assert!(remark.contains(part), "{name}: {remark}");
    }
}

/// A lone stamp that does not increase moves its own frame and no other; what has no times at all is told.
#[test]
fn a_repeated_time_stamp_shifts_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let make = |arguments: &str| ffmpeg(folder.path(), arguments);
    make(&format!("{SOURCE} -frames:v 10 -c:v mjpeg whole.mkv"));
    make("-i whole.mkv -c copy -bsf:v setts=ts=if(eq(N\\,3)\\,67\\,TS) repeated.mkv");
    make("-i whole.mkv -c copy -bsf:v setts=ts=0 zero.mkv");
    let times = |name: &str| {
        let mut source = FrameSource::open(folder.path().join(name).to_str().unwrap()).unwrap();
        let mut times_secs = Vec::new();
        while let Some(frame) = source.next_frame().unwrap() {
            times_secs.push(frame.time_secs);
        }
        assert!(source.notices().is_empty(), "{:?}", source.notices());
        (times_secs, source.remark_of_times())
    };
    let (whole, remark) = times("whole.mkv");
    assert_eq!((whole.len(), remark), (10, None));
    let (repeated, remark) = times("repeated.mkv");
    for (k, (found, own)) in repeated.iter().zip(&whole).enumerate() {
        let is_own = (found - own).abs() < 1e-9;
        let is_between = *found > whole[2] && *found < whole[4];
        assert!(if k == 3 { is_between } else { is_own }, "{repeated:?}");
    }
    let remark = remark.unwrap();
    assert!(
        remark.contains("repeated.mkv: 1 frames had no time"),
        "{remark}"
    );
    let (zero, remark) = times("zero.mkv");
    assert!(zero.windows(2).all(|pair| pair[0] < pair[1]), "{zero:?}");
    let remark = remark.unwrap();
    assert!(remark.contains("9 frames had no time"), "{remark}");
}

/// Recordings that were put one after the other: the second's stamps start again, far below the first's.
#[test]
fn joined_recordings_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, offset) in [("late.ts", 100), ("early.ts", 0)] {
        ffmpeg(
            folder,
            &format!("{SOURCE} -frames:v 12 -c:v mpeg2video -output_ts_offset {offset} {name}"),
        );
    }
    let parts = ["late.ts", "early.ts"].map(|name| std::fs::read(folder.join(name)).unwrap());
    std::fs::write(folder.join("joined.ts"), parts.concat()).unwrap();
    let (frames, _) = all(&folder.join("joined.ts"));
    assert!(frames.len() > 20, "{}", frames.len());
    for pair in frames.windows(2) {
        let step_secs = pair[1].time_secs - pair[0].time_secs;
        assert!((0.01..0.2).contains(&step_secs), "{step_secs}");
    }
}

/// Cut without being encoded anew, frames lack those that they refer to; and Matroska counts its length from 0, wherever it begins.
#[test]
fn what_was_cut_without_being_encoded_anew_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let make = |arguments: &str| ffmpeg(folder.path(), arguments);
    let open = "open-gop=1:keyint=15:min-keyint=15:scenecut=0:bframes=3";
    make(&format!(
        "{SOURCE} -c:v libx264 -x264-params {open} open.mp4"
    ));
    make("-ss 0.6 -copyts -i open.mp4 -c copy late.mkv");
    make("-ss 1.2 -i open.mp4 -c copy cut.mp4");
    for name in ["late.mkv", "cut.mp4"] {
        let path = folder.path().join(name);
        let (frames, notices) = all(&path);
        assert_eq!(notices, [], "{name}");
        assert_eq!(frames.len(), probed_secs(&path).len(), "{name}");
    }
    let late = FrameSource::open(folder.path().join("late.mkv").to_str().unwrap()).unwrap();
    assert_eq!(late.frame_count(), Some(105));
}

/// Pictures that the decoder gives though it could not decode all of them: whenever ffmpeg has a word, so has gnomon.
#[test]
fn what_was_guessed_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let noisy = "-vf noise=alls=20 -frames:v 20 -c:v libx264 -crf 20 -g 5 -pix_fmt yuv420p";
    for name in ["a.mp4", "a.mkv"] {
        ffmpeg(folder.path(), &format!("{SOURCE} {noisy} {name}"));
        let path = folder.path().join(name);
        assert_eq!(all(&path).1, [], "{name}");
        let bytes = std::fs::read(&path).unwrap();
        let (places, sizes) = (probed_packets(&path, "pos"), probed_packets(&path, "size"));
        let largest = (1..sizes.len()).max_by_key(|&k| sizes[k]).unwrap();
        let mut told = 0;
        for part in [3, 4, 5, 6] {
            let mut zeroed = bytes.clone();
            let begin = places[largest] + sizes[largest] * part / 8;
            zeroed[begin..begin + sizes[largest] / 8].fill(0);
            let damaged = folder.path().join(format!("{part}_{name}"));
            std::fs::write(&damaged, zeroed).unwrap();
            let (frames, notices) = all(&damaged);
            assert_eq!(frames.len(), 20, "{name} {part}");
            assert!(
                !notices.is_empty() || !is_complained_of(&damaged),
                "{name} {part}"
            );
            told += usize::from(!notices.is_empty());
        }
        assert!(told > 0, "{name}");
    }
}

/// Whether ffmpeg says anything of a damage.
fn is_complained_of(path: &Path) -> bool {
    let output = Command::new("ffmpeg")
        .args(["-nostdin", "-nostats", "-i"])
        .arg(path)
        .args(["-f", "null", "-"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    ["error while", "concealing", "corrupt decoded"]
        .iter()
        .any(|sign| said.contains(sign))
}

/// What ffprobe tells of each packet.
fn probed_packets(path: &Path, entry: &str) -> Vec<usize> {
    let words = probed_words(path, &format!("packet={entry}"));
    words.iter().filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn a_second_video_and_too_many_pixels_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    ffmpeg(
        folder.path(),
        &format!(
            "{SOURCE} -f lavfi -i testsrc=size=64x48 -map 0 -map 1 -frames:v 3 -pix_fmt yuv420p two.mp4"
        ),
    );
    let remark = FrameSource::open(&inside("two.mp4")).unwrap().remark();
    let remark = remark.unwrap_or_default();
    assert!(remark.contains("it holds 2 videos"), "{remark}");
    ffmpeg(
        folder.path(),
        "-f lavfi -i color=size=8192x6144 -frames:v 1 -c:v mjpeg -pix_fmt yuvj420p huge.avi",
    );
    let refused = FrameSource::open(&inside("huge.avi")).err().unwrap();
    let refused = refused.to_string();
    assert!(
        refused.contains("not one frame") && refused.contains("more than 33554432 pixels"),
        "{refused}"
    );
}

/// SMPTE 240M beside BT.709, which it is near, and a matrix that is none of luma and two differences.
#[test]
fn rare_matrices_are_read_or_told() {
    let folder = tempfile::tempdir().unwrap();
    let make = |matrix: &str, name: &str| {
        let to = "scale=out_color_matrix=smpte240m:out_range=tv:flags=accurate_rnd+full_chroma_int";
        ffmpeg(
            folder.path(),
            &format!(
                "-f lavfi -i color=0x2832d2:size=64x48 -frames:v 1 -vf {to},format=yuv444p,setparams=range=tv:colorspace={matrix} -c:v ffv1 {name}"
            ),
        );
        FrameSource::open(folder.path().join(name).to_str().unwrap()).unwrap()
    };
    let mut read = make("smpte240m", "a.mkv");
    assert_eq!(read.remark(), None);
    let frame = read.next_frame().unwrap().unwrap();
    for (found, expected) in frame.rgba.iter().zip([0x28_u8, 0x32, 0xd2]) {
        assert!(found.abs_diff(expected) <= 2, "{:?}", &frame.rgba[..3]);
    }
    for matrix in ["ycgco", "ictcp"] {
        let remark = make(matrix, "b.mkv").remark().unwrap_or_default();
        assert!(remark.contains(&format!("coded by {matrix}")), "{remark}");
    }
}
