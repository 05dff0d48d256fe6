//! What ffmpeg says while it decodes: a line a frame from its filter `showinfo`, and its complaints.
//!
//! `showinfo` prints for each frame `n: 3 pts: 1536 … fmt:yuv420p … s:640x480 …`, and in a line of its own
//! `color_range:tv color_space:bt709 …`; so it has since FFmpeg 4, and FFmpeg 8 still does.

/// A line that means something.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    /// The file was opened.
    Input,
    /// There is sound in it, or a picture.
    Stream,
    /// A video was found in it, and is decoded.
    Decoding,
    /// The decoder that is at work, by FFmpeg's name of it.
    Decoder(String),
    /// Of the frames that follow.
    TimeBase {
        /// Seconds that a tick of the time stamps lasts.
        tick_secs: f64,
        /// Frames per second, where they are known.
        fps: Option<f64>,
    },
    /// A frame is about to come.
    Frame(FrameHead),
    /// The colours of the frame that was told last.
    Colours(ColourTags),
    /// The frame that comes next has errors in it.
    Corrupt,
    /// The reader or the decoder cannot make something of the file.
    Complaint {
        /// FFmpeg's name of the part that complains; empty where it is FFmpeg itself.
        by: String,
        /// What it says.
        words: String,
    },
    /// Nothing can be done with it at all.
    Fatal(String),
}

/// What a frame is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameHead {
    /// Its time stamp in ticks; some streams have none.
    pub stamp: Option<i64>,
    /// FFmpeg's name of its pixel format.
    pub pixels: String,
    /// Width and height, pixels.
    pub size_px: [u32; 2],
}

/// FFmpeg's names of a frame's colours; `unknown` where the stream says nothing.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ColourTags {
    /// Which levels are used: `tv` or `pc`.
    pub range: String,
    /// From luma and chroma to RGB.
    pub matrix: String,
    /// The colours of R, G and B.
    pub primaries: String,
    /// From levels to light.
    pub transfer: String,
}

/// What a line means; `None` where it does not matter. The lines are those of `-loglevel repeat+level+info`.
pub fn meaning(line: &str) -> Option<Said> {
    if line.starts_with("[Parsed_showinfo") {
        let (_, said) = line.split_once("[info] ")?;
        return of_showinfo(said);
    }
    // A picture of its own that ends too soon is given all the same.
    let is_too_large = line.contains("max pixel count");
    let is_half_jpeg = line.starts_with("[mjpeg")
        && (line.contains("[error] ") || line.contains("EOI missing"))
        && !is_too_large;
    if is_half_jpeg || line.contains("corrupt decoded frame") {
        return Some(Said::Corrupt);
    }
    // What comes after the decoder is ours: it complains of time stamps that it does not need.
    if line.starts_with("[rawvideo") || line.starts_with("[out#") || line.starts_with("[vf#") {
        return None;
    }
    if let Some((_, words)) = line.split_once("[fatal] ") {
        return Some(Said::Fatal(words.trim().to_owned()));
    }
    if let Some(words) = complaint_in(line) {
        return (!is_harmless(words)).then(|| Said::Complaint {
            by: speaker_of(line).to_owned(),
            words: words.to_owned(),
        });
    }
    if line.starts_with("[info] Stream mapping:") {
        return Some(Said::Decoding);
    }
    let stream = line.strip_prefix("[info]").map(str::trim_start);
    if let Some((_, said)) = stream.and_then(|said| said.split_once(" -> #0:0 (")) {
        return decoder_in(said).map(|name| Said::Decoder(name.to_owned()));
    }
    // (What a cut-off index leaves is called data.)
    if let Some(said) = stream.filter(|said| said.starts_with("Stream #0:")) {
        let is_media = said.contains(": Audio:") || said.contains(": Video:");
        return is_media.then_some(Said::Stream);
    }
    line.starts_with("[info] Input #0").then_some(Said::Input)
}

/// What a line complains of. That parts of a picture were guessed is told as a mere information.
fn complaint_in(line: &str) -> Option<&str> {
    let error = line.split_once("[error] ").map(|(_, words)| words.trim());
    let guessed = || {
        let (_, words) = line.split_once("[info] ")?;
        words.starts_with("concealing ").then_some(words.trim())
    };
    error.or_else(guessed)
}

/// Whether nothing of the pictures that the file has is lost by it: the decoder misses, or is told to forget, pictures before the
/// first one. So it is where a recording was cut without being encoded anew.
fn is_harmless(words: &str) -> bool {
    const SIGNS: [&str; 6] = [
        "mmco:",
        "Missing reference picture",
        "reference picture missing",
        "co located POCs unavailable",
        "Could not find ref with POC",
        "Warning MVs not available",
    ];
    SIGNS.iter().any(|sign| words.starts_with(sign))
}

/// Whether a decoder complains that it was never told how a picture is coded, which it then does not give. So begins a stream that
/// was taken up in its middle.
pub fn is_of_missing_headers(words: &str) -> bool {
    const SIGNS: [&str; 5] = [
        "non-existing PPS",
        "non-existing SPS",
        "PPS id out of range",
        "decode_slice_header error",
        "no frame!",
    ];
    SIGNS.iter().any(|sign| words.starts_with(sign))
}

/// The part of FFmpeg that a line is of: `h264` in `[h264 @ 0x5] [error] …`.
fn speaker_of(line: &str) -> &str {
    let inside = line
        .strip_prefix('[')
        .and_then(|rest| rest.split_once(" @ "));
    inside.map_or("", |(name, _)| name)
}

/// The decoder in `h264 (native) -> rawvideo (native))`, or in `av1 (libdav1d) -> …`.
fn decoder_in(mapping: &str) -> Option<&str> {
    let (codec, rest) = mapping.split_once(" (")?;
    let (name, _) = rest.split_once(')')?;
    Some(if name == "native" { codec } else { name })
}

fn of_showinfo(said: &str) -> Option<Said> {
    if let Some(config) = said.strip_prefix("config in time_base: ") {
        let (tick, _) = config.split_once(',')?;
        let tick_secs = ratio(tick)?;
        let fps = value_of(config, "frame_rate: ").and_then(ratio);
        return Some(Said::TimeBase { tick_secs, fps });
    }
    if said.starts_with("color_range:") {
        let value = |key| value_of(said, key).unwrap_or("unknown").to_owned();
        return Some(Said::Colours(ColourTags {
            range: value("color_range:"),
            matrix: value("color_space:"),
            primaries: value("color_primaries:"),
            transfer: value("color_trc:"),
        }));
    }
    if !said.starts_with("n:") {
        return None;
    }
    let (width, height) = value_of(said, " s:")?.split_once('x')?;
    Some(Said::Frame(FrameHead {
        stamp: value_of(said, " pts:")?.parse().ok(),
        pixels: value_of(said, " fmt:")?.to_owned(),
        size_px: [width.parse().ok()?, height.parse().ok()?],
    }))
}

/// The word after a key; there may be spaces between.
fn value_of<'a>(line: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = line.split_once(key)?;
    rest.split_whitespace().next()
}

/// A fraction as FFmpeg writes it (`30000/1001`), as a number; `None` where it is none (`0/0`).
pub fn ratio(text: &str) -> Option<f64> {
    let (above, below) = text.trim().split_once('/')?;
    let (above, below): (f64, f64) = (above.parse().ok()?, below.parse().ok()?);
    Some(above / below).filter(|ratio| ratio.is_finite() && *ratio > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_ffmpeg_5_and_7_are_read() {
        let of_5 = "[Parsed_showinfo_1 @ 0x55f5] [info] n:   3 pts:   1536 pts_time:0.1     pos:    16525 \
                    fmt:yuv420p10le sar:0/1 s:640x480 i:P iskey:0 type:B ";
        let of_7 = "[Parsed_showinfo_1 @ 0x55f5] [info] n:   3 pts:   1536 pts_time:0.1     duration:    512 \
                    duration_time:0.0333333 fmt:yuv420p10le cl:left sar:0/1 s:640x480 i:P iskey:0 type:B ";
        let expected = Said::Frame(FrameHead {
            stamp: Some(1536),
            pixels: "yuv420p10le".to_owned(),
            size_px: [640, 480],
        });
        assert_eq!(meaning(of_5), Some(expected.clone()));
        assert_eq!(meaning(of_7), Some(expected));
        let unstamped = of_5.replace("pts:   1536", "pts:  NOPTS");
        assert!(matches!(
            meaning(&unstamped),
            Some(Said::Frame(FrameHead { stamp: None, .. }))
        ));
    }

    fn complaint(by: &str, words: &str) -> Said {
        Said::Complaint {
            by: by.to_owned(),
            words: words.to_owned(),
        }
    }

    #[test]
    fn time_base_colours_and_complaints_are_read() {
        let base =
            "[Parsed_showinfo_1 @ 0x1] [info] config in time_base: 1/15360, frame_rate: 30/1";
        let tick_secs = 1.0 / 15360.0;
        let fps = Some(30.0);
        assert_eq!(meaning(base), Some(Said::TimeBase { tick_secs, fps }));
        let none = "[Parsed_showinfo_1 @ 0x1] [info] config out time_base: 0/0, frame_rate: 0/0";
        assert_eq!(meaning(none), None);
        let tags = "[Parsed_showinfo_1 @ 0x1] [info] color_range:tv color_space:bt2020nc color_primaries:bt2020 \
                    color_trc:arib-std-b67";
        let words = |word: &str| word.to_owned();
        assert_eq!(
            meaning(tags),
            Some(Said::Colours(ColourTags {
                range: words("tv"),
                matrix: words("bt2020nc"),
                primaries: words("bt2020"),
                transfer: words("arib-std-b67"),
            }))
        );
        let broken = "[h264 @ 0x5] [error] Invalid NAL unit size (1 > 0).";
        assert_eq!(
            meaning(broken),
            Some(complaint("h264", "Invalid NAL unit size (1 > 0)."))
        );
        let guessed = "[h264 @ 0x5] [info] concealing 9 DC, 9 AC, 9 MV errors in P frame";
        let words = "concealing 9 DC, 9 AC, 9 MV errors in P frame";
        assert_eq!(meaning(guessed), Some(complaint("h264", words)));
        let by_itself = "[error] Error while decoding stream #0:0: Invalid data found";
        let words = "Error while decoding stream #0:0: Invalid data found";
        assert_eq!(meaning(by_itself), Some(complaint("", words)));
        // A recording that was cut without being encoded anew.
        let cut = "[h264 @ 0x5] [error] mmco: unref short failure";
        assert_eq!(meaning(cut), None);
        for (mapping, name) in [
            ("h264 (native) -> rawvideo (native)", "h264"),
            ("av1 (libdav1d) -> rawvideo (native)", "libdav1d"),
        ] {
            let line = format!("[info]   Stream #0:1 -> #0:0 ({mapping})");
            assert_eq!(meaning(&line), Some(Said::Decoder(name.to_owned())));
        }
        let sound = "[info]   Stream #0:0[0x1](und): Audio: aac (LC), 44100 Hz, mono";
        assert_eq!(meaning(sound), Some(Said::Stream));
        assert_eq!(
            meaning("[info]   Stream #0:0[0x1]: Data: none (default)"),
            None
        );
        let ours = "[rawvideo @ 0x5] [error] Application provided invalid dts";
        assert_eq!(meaning(ours), None);
        let corrupt = "[warning] file:a.mp4: corrupt decoded frame in stream 0";
        assert_eq!(meaning(corrupt), Some(Said::Corrupt));
    }
}
