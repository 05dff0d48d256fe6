//! What the window says to the person who holds the target.

use super::watcher::{SolvedViews, ViewsStanding};
use crate::calibration::{FEWEST_VIEWS, Lack, Moment, Target};

/// What to do next.
pub fn advice(standing: &ViewsStanding, target: &Target) -> String {
    let next_view = next_view(standing);
    match standing.moment {
        Some(Moment::NoTarget) if target.markers.is_some() => {
            format!("The board is not seen. {next_view}")
        }
        Some(Moment::NoTarget) => {
            format!("The chessboard is not seen: it must be whole in the picture. {next_view}")
        }
        Some(Moment::Moves) => "Hold it still …".to_owned(),
        Some(Moment::Taken) => format!("Taken. {next_view}"),
        Some(Moment::Known) | None => next_view,
    }
}

/// What the views lack most.
fn next_view(standing: &ViewsStanding) -> String {
    let of = |wanted: fn(&Lack) -> bool| standing.lacks.iter().find(|lack| wanted(lack));
    if standing.taken > 0
        && let Some(Lack::Coverage { missing, .. }) =
            of(|lack| matches!(lack, Lack::Coverage { .. }))
    {
        return match missing.first() {
            Some(part) => format!("Bring it to the {part} of the picture."),
            None => "Bring it to where the picture is tinted.".to_owned(),
        };
    }
    if standing.taken > 0 && of(|lack| matches!(lack, Lack::Tilt { .. })).is_some() {
        return "Tilt it by 20 to 40 degrees, to all sides.".to_owned();
    }
    match of(|lack| matches!(lack, Lack::Views { .. })) {
        Some(_) if standing.taken == 0 => "Hold the target to the camera, and still.".to_owned(),
        Some(_) => "Show it otherwise: nearer, farther, turned, tilted.".to_owned(),
        None => "That is enough: Enter writes the calibration.".to_owned(),
    }
}

/// What there is.
pub fn balance(standing: &ViewsStanding) -> String {
    let views = match standing.taken {
        1 => "1 view".to_owned(),
        taken => format!("{taken} views"),
    };
    let share = standing
        .coverage
        .as_ref()
        .map_or(0.0, |coverage| coverage.share());
    let solved = match &standing.solved {
        Some(Ok(SolvedViews {
            rms_px,
            focal_px: [focal_px, deviation_px],
        })) => format!(
            " · {rms_px:.2} px rms · focal length {:.1} ± {:.1}, {:.1} ± {:.1} px",
            focal_px.x, deviation_px.x, focal_px.y, deviation_px.y
        ),
        Some(Err(reason)) => format!(" · {reason}"),
        None => format!(" of the {FEWEST_VIEWS} that are the least"),
    };
    format!(
        "{views}{solved} · {:.0} % of the picture covered",
        100.0 * share
    )
}

/// Why there is nothing to write yet; `None` where there is.
pub fn refusal(standing: Option<&ViewsStanding>) -> Option<String> {
    match standing.map(|standing| (standing.taken, &standing.solved)) {
        Some((_, Some(Ok(_)))) => None,
        Some((_, Some(Err(reason)))) => Some(reason.clone()),
        other => Some(format!(
            "At least {FEWEST_VIEWS} different views are needed; there are {}.",
            other.map_or(0, |(taken, _)| taken)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn it_says_what_is_lacking_most_and_when_it_is_enough() {
        let chessboard = Target::chessboard([8, 5], 0.025).unwrap();
        let mut standing = ViewsStanding {
            moment: Some(Moment::NoTarget),
            size_px: [640, 480],
            target_px: None,
            taken: 0,
            lacks: vec![
                Lack::Views { have: 0 },
                Lack::Tilt { have: 0 },
                Lack::Coverage {
                    share: 0.0,
                    missing: vec!["top left", "top"],
                },
            ],
            coverage: None,
            solved: None,
            passed_over: None,
        };
        let first = advice(&standing, &chessboard);
        assert!(
            first.contains("must be whole") && first.contains("Hold the target"),
            "{first}"
        );
        assert!(refusal(Some(&standing)).is_some_and(|reason| reason.contains("there are 0")));
        (standing.taken, standing.moment) = (1, Some(Moment::Taken));
        assert_eq!(
            advice(&standing, &chessboard),
            "Taken. Bring it to the top left of the picture."
        );
        standing.moment = Some(Moment::Moves);
        assert_eq!(advice(&standing, &chessboard), "Hold it still …");
        standing.moment = Some(Moment::Known);
        standing.lacks.pop();
        assert!(advice(&standing, &chessboard).starts_with("Tilt it"));
        standing.lacks.pop();
        assert!(advice(&standing, &chessboard).starts_with("Show it otherwise"));
        standing.lacks.clear();
        standing.solved = Some(Err("no focal length".to_owned()));
        assert_eq!(refusal(Some(&standing)).as_deref(), Some("no focal length"));
        standing.solved = Some(Ok(SolvedViews {
            rms_px: 0.123,
            focal_px: [DVec2::new(600.0, 601.0), DVec2::new(1.0, 2.0)],
        }));
        assert!(advice(&standing, &chessboard).contains("Enter"));
        assert_eq!(refusal(Some(&standing)), None);
        assert!(balance(&standing).contains("0.12 px rms"));
    }
}
