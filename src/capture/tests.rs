//! Whole recordings, made by ffmpeg in a temporary folder, then cut, broken and mixed.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::*;

/// A moving test picture; every frame a key frame, so that a break harms no other frame.
fn make_video(path: &Path, frames: u32, size: &str) {
    let source = format!("testsrc2=size={size}:rate=30");
    let status = Command::new("ffmpeg")
        .args([
            "-v",
            "error",
            "-y",
            "-f",
            "lavfi",
            "-i",
            &source,
            "-frames:v",
            &frames.to_string(),
        ])
        .args([
            "-c:v",
            "libx264",
            "-preset",
            "ultrafast",
            "-g",
            "1",
            "-pix_fmt",
            "yuv420p",
            "-movflags",
            "+faststart",
        ])
        .arg(path)
        .status()
        .unwrap();
    assert!(status.success());
}

fn make_images(folder: &Path, count: u32) {
    for index in 0..count {
        let picture = image::RgbImage::from_pixel(32, 24, image::Rgb([index as u8, 100, 200]));
        picture
            .save(folder.join(format!("shot_{index}.png")))
            .unwrap();
    }
}

fn open(path: &Path) -> Result<FrameSource, CaptureError> {
    FrameSource::open(path.to_str().unwrap())
}

fn indices(source: &mut FrameSource) -> Vec<u32> {
    let mut found = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        assert_eq!(
            frame.rgba.len(),
            (frame.size_px[0] * frame.size_px[1] * 4) as usize
        );
        found.push(frame.index);
    }
    assert!(
        source.next_frame().unwrap().is_none(),
        "the end stays the end"
    );
    found
}

fn said(source: &FrameSource) -> String {
    source
        .notices()
        .iter()
        .map(Notice::to_string)
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn a_whole_video_gives_all_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mp4");
    make_video(&path, 20, "64x48");
    let mut source = open(&path).unwrap();
    assert_eq!(
        (source.frame_count(), source.fps(), source.size_px()),
        (Some(20), 30.0, [64, 48])
    );
    assert!(source.calibration().is_none());
    let first = source.next_frame().unwrap().unwrap();
    let second = source.next_frame().unwrap().unwrap();
    assert_eq!((first.index, second.index), (0, 1));
    assert!((second.time_secs - 1.0 / 30.0).abs() < 1e-12);
    assert!(
        first
            .rgba
            .iter()
            .skip(3)
            .step_by(4)
            .all(|&alpha| alpha == 255)
    );
    assert_ne!(first.rgba, second.rgba);
    assert_eq!(indices(&mut source), (2..20).collect::<Vec<_>>());
    assert_eq!(source.notices(), []);
}

#[test]
fn reordered_frames_keep_their_indices() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mp4");
    let status = Command::new("ffmpeg")
        .args([
            "-v",
            "error",
            "-f",
            "lavfi",
            "-i",
            "testsrc2=size=64x48:rate=25",
            "-frames:v",
            "20",
        ])
        .args(["-c:v", "libx264", "-bf", "3"])
        .arg(&path)
        .status()
        .unwrap();
    assert!(status.success());
    let mut source = open(&path).unwrap();
    assert_eq!(indices(&mut source), (0..20).collect::<Vec<_>>());
    assert_eq!(source.notices(), []);
}

#[test]
fn a_video_cut_off_gives_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.mp4");
    make_video(&path, 40, "160x120");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let mut source = open(&path).unwrap();
    let found = indices(&mut source);
    assert!((10..30).contains(&found.len()), "{found:?}");
    assert_eq!(found, (0..found.len() as u32).collect::<Vec<_>>());
    let text = said(&source);
    assert!(
        text.contains("cut.mp4: ends early, at frame") && text.contains("of 40"),
        "{text}"
    );
    assert_eq!(source.notices()[0].lost_frames(), 40 - found.len() as u32);
}

#[test]
fn a_video_cut_off_before_its_index_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.mp4");
    make_video(&path, 20, "64x48");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..200]).unwrap();
    let text = open(&path).err().unwrap().to_string();
    assert!(
        text.contains("cut.mp4: cannot be opened as a video"),
        "{text}"
    );
}

#[test]
fn a_video_broken_in_the_middle_goes_on_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.mp4");
    make_video(&path, 40, "160x120");
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    // As long as some frames, of bytes that no packet begins with.
    let broken = bytes.len() / 10;
    bytes[middle..middle + broken].fill(0xff);
    fs::write(&path, &bytes).unwrap();
    let mut source = open(&path).unwrap();
    let found = indices(&mut source);
    let text = said(&source);
    assert!((30..40).contains(&found.len()), "{found:?} {text}");
    assert_eq!(
        (found[0], found[found.len() - 1]),
        (0, 39),
        "{found:?} {text}"
    );
    assert!(found.windows(2).all(|pair| pair[0] < pair[1]), "{found:?}");
    assert!(
        text.contains("broken.mp4: frames") && text.contains("are broken or missing"),
        "{text}"
    );
    let lost: u32 = source.notices().iter().map(Notice::lost_frames).sum();
    assert_eq!(lost + source.good_frames(), 40);
}

#[test]
fn a_session_brings_its_calibration_and_times() {
    let folder = tempfile::tempdir().unwrap();
    make_video(&folder.path().join("video.mp4"), 3, "64x48");
    let calibration = "size_px = [64, 48]\nfocal_px = [60, 60]\ncenter_px = [31.5, 23.5]\n";
    fs::write(folder.path().join("camera.toml"), calibration).unwrap();
    fs::write(
        folder.path().join("times.csv"),
        "frame,time_s\n0,0\n1,0.05\n2,0.09\n",
    )
    .unwrap();
    let mut source = open(folder.path()).unwrap();
    assert_eq!(source.calibration().unwrap().focal_px.x, 60.0);
    assert!(check_frame_size(&source.calibration().unwrap(), source.size_px(), "it").is_ok());
    source.next_frame().unwrap();
    assert_eq!(source.next_frame().unwrap().unwrap().time_secs, 0.05);

    let other = calibration
        .replace("64, 48", "640, 480")
        .replace("60, 60", "600, 600");
    fs::write(folder.path().join("camera.toml"), other).unwrap();
    let source = open(folder.path()).unwrap();
    let text = check_frame_size(&source.calibration().unwrap(), source.size_px(), "it")
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("64 x 48") && text.contains("640 x 480"),
        "{text}"
    );

    fs::write(folder.path().join("times.csv"), "frame,time_s\n0,x\n").unwrap();
    assert!(
        open(folder.path())
            .err()
            .unwrap()
            .to_string()
            .contains("times.csv:2:")
    );
}

#[test]
fn images_come_in_the_order_of_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    make_images(folder.path(), 12);
    fs::write(folder.path().join("notes.txt"), "not a picture").unwrap();
    let mut source = open(folder.path()).unwrap();
    assert_eq!(
        (source.frame_count(), source.fps(), source.size_px()),
        (Some(12), 30.0, [32, 24])
    );
    for index in 0..12 {
        let frame = source.next_frame().unwrap().unwrap();
        assert_eq!(
            (frame.index, &frame.rgba[..4]),
            (index, &[index as u8, 100, 200, 255][..])
        );
    }
    assert!(source.next_frame().unwrap().is_none());
}

#[test]
fn a_broken_image_and_one_of_another_size_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    make_images(folder.path(), 6);
    fs::write(folder.path().join("shot_2.png"), "no picture").unwrap();
    image::RgbImage::new(33, 24)
        .save(folder.path().join("shot_4.png"))
        .unwrap();
    let mut source = open(folder.path()).unwrap();
    assert_eq!(indices(&mut source), [0, 1, 3, 5]);
    let text = said(&source);
    assert!(text.contains("shot_2.png: frame 2 is broken"), "{text}");
    assert!(
        text.contains("shot_4.png: frame 4 is 33 x 24, the first one was 32 x 24"),
        "{text}"
    );
}

#[test]
fn hidden_files_are_no_frames_and_times_go_on() {
    let folder = tempfile::tempdir().unwrap();
    make_images(folder.path(), 4);
    for name in ["._shot_1.png", ".DS_Store", ".hidden.png"] {
        fs::write(folder.path().join(name), "no picture").unwrap();
    }
    fs::write(
        folder.path().join("times.csv"),
        "frame,time_s\n0,0\n1,0.1\n",
    )
    .unwrap();
    let mut source = open(folder.path()).unwrap();
    let remark = source.remark().unwrap();
    assert!(remark.contains("times for 2 of 4 frames"), "{remark}");
    let mut secs = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        secs.push(frame.time_secs);
    }
    assert_eq!(secs.len(), 4, "{}", said(&source));
    for (found, expected) in secs.iter().zip([0.0, 0.1, 0.2, 0.3]) {
        assert!((found - expected).abs() < 1e-9, "{secs:?}");
    }
    assert!(source.notices().is_empty(), "{}", said(&source));
}

#[test]
fn a_video_s_missing_times_are_told() {
    let folder = tempfile::tempdir().unwrap();
    make_video(&folder.path().join("video.mp4"), 5, "64x48");
    let times = folder.path().join("times.csv");
    fs::write(&times, "\u{feff}frame,time_s\n0,0\n1,0.1\n").unwrap();
    let mut source = open(folder.path()).unwrap();
    let remark = source.remark().unwrap();
    assert!(
        remark.contains("times.csv: it has times for 2 of 5 frames"),
        "{remark}"
    );
    assert_eq!(indices(&mut source).len(), 5);
    assert_eq!(source.remark_of_times(), None);
}

#[test]
fn pictures_that_are_passed_over_are_told() {
    let folder = tempfile::tempdir().unwrap();
    make_images(folder.path(), 2);
    assert_eq!(open(folder.path()).unwrap().remark(), None);
    let heic = folder.path().join("a.heic");
    fs::write(&heic, b"\0\0\0\x1cftypheic\0\0\0\0mif1heic").unwrap();
    fs::write(folder.path().join("b.GIF"), "GIF89a").unwrap();
    let remark = open(folder.path()).unwrap().remark().unwrap();
    assert!(
        remark.contains("a.heic, b.GIF are passed over: such pictures have to be saved as JPEG"),
        "{remark}"
    );
    let refused = open(&heic).err().unwrap().to_string();
    assert!(refused.contains("have to be saved as JPEG"), "{refused}");
}

/// A decoder fills up what a JPEG has lost; its end tells. What cameras add behind it is no harm.
#[test]
fn a_jpeg_that_is_cut_off_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let picture = image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([(x * y) as u8; 3]));
    let whole = folder.path().join("0.jpg");
    picture.save(&whole).unwrap();
    let bytes = fs::read(&whole).unwrap();
    let with_more = [&bytes[..], b"a camera's own"].concat();
    fs::write(folder.path().join("1.jpg"), with_more).unwrap();
    fs::write(folder.path().join("2.jpg"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    let mut source = open(folder.path()).unwrap();
    assert_eq!(indices(&mut source), [0, 1, 2]);
    let text = said(&source);
    assert!(
        text.contains("2.jpg: 1 frames, the first of them 2, have errors"),
        "{text}"
    );
    assert_eq!(source.notices().len(), 1, "{text}");
}

#[test]
fn pictures_of_several_and_of_other_kinds_are_told() {
    let folder = tempfile::tempdir().unwrap();
    make_images(folder.path(), 3);
    // An animation's control comes after the head's 33 bytes.
    let path = folder.path().join("shot_1.png");
    let plain = fs::read(&path).unwrap();
    let control = b"\0\0\0\x08acTL\0\0\0\x03\0\0\0\0\0\0\0\0";
    fs::write(&path, [&plain[..33], control, &plain[33..]].concat()).unwrap();
    let heic = b"\0\0\0\x1cftypheic\0\0\0\0mif1heicmiaf";
    fs::write(folder.path().join("shot_2.png"), heic).unwrap();
    let mut source = open(folder.path()).unwrap();
    indices(&mut source);
    let told = said(&source);
    for part in ["shot_1.png: holds 3 pictures", "frame 2 is a HEIC picture"] {
        assert!(told.contains(part), "{told}");
    }
    for (bytes, part) in [
        (&heic[..], "it is a HEIC picture"),
        (
            b"RIFF\x20\0\0\0WEBPVP8X\x0a\0\0\0\x02\0\0\0",
            "it is an animated WebP",
        ),
    ] {
        let path = folder.path().join("one.jpg");
        fs::write(&path, bytes).unwrap();
        let told = open(&path).err().unwrap().to_string();
        assert!(told.contains(part), "{told}");
    }
}

#[test]
fn a_folder_says_what_it_has_instead() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |source: &Path| open(source).err().unwrap().to_string();
    assert!(refused(folder.path()).contains("it is empty"));
    fs::create_dir(folder.path().join("views")).unwrap();
    let said = refused(folder.path());
    assert!(said.contains("nothing but folders (views)"), "{said}");
    fs::write(folder.path().join("IMG_1.HEIC"), "x").unwrap();
    let heic = refused(folder.path());
    assert!(
        heic.contains("it has IMG_1.HEIC, which have to be saved as JPEG"),
        "{heic}"
    );
    fs::write(folder.path().join("GX01.MP4"), "x").unwrap();
    let video = refused(folder.path());
    assert!(
        video.contains("by its own path, as") && video.contains("GX01.MP4"),
        "{video}"
    );
    let pattern = refused(&folder.path().join("%06d.png"));
    assert!(pattern.contains("without a pattern"), "{pattern}");
    for (name, text, part) in [
        (
            "a.mp4",
            "version https://git-lfs.github.com/spec/v1\n",
            "Git LFS",
        ),
        ("b.mp4", "<!DOCTYPE html>", "a page of the web"),
        ("c.mp4", "", "the file is empty"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        let said = refused(&path);
        assert!(said.contains(part), "{name}: {said}");
    }
}

#[test]
fn notices_of_a_kind_are_told_as_one() {
    let other = |frame| Notice::OtherSize {
        path: "a.ts".into(),
        frame,
        size_px: [4, 2],
        expected_px: [2, 2],
    };
    let broken = Notice::Corrupt {
        path: "a.ts".into(),
        first: 9,
        count: 1,
    };
    let told = notices_told(&[other(3), other(4), broken, other(7)]);
    let parts: Vec<&str> = told.split("; ").collect();
    assert!(
        told.contains("frame 3 is 4 x 2") && told.contains("left out (and 1 more such)"),
        "{told}"
    );
    assert!(
        told.contains("frame 7") && !told.contains("frame 4"),
        "{told}"
    );
    assert!(parts.len() >= 3);
}

#[test]
fn what_is_no_recording_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |source: &str| FrameSource::open(source).err().unwrap().to_string();
    let inside = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    assert!(refused("webcam:0").contains("gnomon record webcam:0"));
    assert!(refused("http://camera.local/stream").contains("gnomon record http://"));
    assert!(refused(&inside("nothing.mp4")).contains("nothing.mp4: no such file or folder"));
    assert!(refused(&inside("")).contains("neither a video"));
    fs::write(folder.path().join("a.png"), "no picture").unwrap();
    assert!(refused(&inside("")).contains("not one frame can be decoded"));
    assert!(refused(&inside("a.png")).contains("a.png: not one frame can be decoded"));
    fs::write(folder.path().join("empty.mp4"), "").unwrap();
    assert!(refused(&inside("empty.mp4")).contains("empty.mp4: cannot be opened as a video"));
    fs::write(folder.path().join("video.mp4"), "").unwrap();
    fs::write(folder.path().join("video.mkv"), "").unwrap();
    assert!(refused(&inside("")).contains("could be the session's video"));
}
