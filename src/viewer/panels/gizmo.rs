//! The axes in a corner of the picture: shows how the camera is turned, and turns it.
//!
//! Six discs on the ends of the axes, those behind painted first. A click on one looks from there; dragging anywhere on
//! the gizmo orbits.

use egui::{Align2, Color32, FontId, Pos2, Rect, Response, Role, Sense, Stroke, Ui, Vec2, WidgetInfo};
use glam::{DQuat, DVec3};

use crate::scene::views::{StandardView, UpAxis};

/// How far the middles of the discs are from the middle of the gizmo, in points.
const ARM: f32 = 36.0;
/// The radius of a disc.
const DISC: f32 = 10.0;

/// What the user did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GizmoEvent {
    /// Look from a side.
    View(StandardView),
    /// Orbit by so many points: right, down.
    Orbit(Vec2),
}

/// One end of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
struct End {
    /// 0, 1 or 2 for x, y or z.
    axis: usize,
    is_positive: bool,
    /// Where it is from the middle of the gizmo, in points.
    offset: Vec2,
    /// How near to the eye it is, from -1 to 1.
    nearness: f64,
}

impl End {
    fn direction(axis: usize, is_positive: bool) -> DVec3 {
        DVec3::AXES[axis] * if is_positive { 1.0 } else { -1.0 }
    }

    fn name(&self) -> String {
        format!("{}{}", if self.is_positive { '+' } else { '-' }, ['X', 'Y', 'Z'][self.axis])
    }

    /// The side from which one looks from there.
    fn view(&self, up: UpAxis) -> StandardView {
        let outward = Self::direction(self.axis, self.is_positive);
        let from = |view: &StandardView| (view.orientation(up) * DVec3::Z).dot(outward);
        let best = StandardView::ALL.into_iter().max_by(|a, b| from(a).total_cmp(&from(b)));
        best.unwrap_or_default()
    }
}

/// The ends of the axes as a camera sees them, those farthest from the eye first.
fn ends(world_from_view: DQuat) -> Vec<End> {
    let mut ends: Vec<End> = (0..6)
        .map(|number| {
            let (axis, is_positive) = (number / 2, number % 2 == 0);
            let seen = world_from_view.conjugate() * End::direction(axis, is_positive);
            let offset = Vec2::new(seen.x as f32, -seen.y as f32) * ARM;
            End { axis, is_positive, offset, nearness: seen.z }
        })
        .collect();
    ends.sort_by(|a, b| a.nearness.total_cmp(&b.nearness));
    ends
}

/// The size of the gizmo, in points.
pub const SIZE: f32 = 2.0 * (ARM + DISC + 4.0);

/// Paints the gizmo in the upper right corner of a rectangle of the picture, for a camera that is turned so, and says
/// what the user did to it. Paint it after the picture, so that it takes the mouse first. Nothing is painted where the
/// picture is too small for it.
pub fn show(ui: &mut Ui, picture: Rect, world_from_view: DQuat, up: UpAxis) -> Option<GizmoEvent> {
    if picture.width() < 1.5 * SIZE || picture.height() < 1.5 * SIZE {
        return None;
    }
    let corner = picture.right_top() + Vec2::new(-8.0 - SIZE, 8.0);
    let place = Rect::from_min_size(corner, Vec2::splat(SIZE));
    let id = ui.scope_id().with("axes gizmo");
    let whole = ui.interact(place, id, Sense::drag());
    let mut event = orbit_of(&whole);
    let is_near = whole.contains_pointer();
    if is_near || whole.dragged() {
        let shade = ui.visuals().widgets.hovered.bg_fill.gamma_multiply(0.35);
        ui.painter().circle_filled(place.center(), 0.5 * SIZE, shade);
    }
    for end in ends(world_from_view) {
        let at = place.center() + end.offset;
        let square = Rect::from_center_size(at, Vec2::splat(2.0 * DISC));
        let response = ui.interact(square, id.with((end.axis, end.is_positive)), Sense::click_and_drag());
        let label = format!("View from {}", end.name());
        response.widget_info(|| WidgetInfo::labeled(Role::Button, true, &label));
        paint(ui, place.center(), at, &end, response.hovered() || response.has_focus());
        event = event.or_else(|| orbit_of(&response));
        if response.clicked() {
            event = Some(GizmoEvent::View(end.view(up)));
        }
        response.on_hover_text(format!("{label} ({})", end.view(up).word()));
    }
    event
}

fn orbit_of(response: &Response) -> Option<GizmoEvent> {
    let moved = response.drag_delta();
    (response.dragged() && moved != Vec2::ZERO).then_some(GizmoEvent::Orbit(moved))
}

fn paint(ui: &Ui, middle: Pos2, at: Pos2, end: &End, is_hovered: bool) {
    let painter = ui.painter();
    let colour = colour_of(end);
    if end.is_positive {
        painter.line_segment([middle, at], Stroke::new(2.0, colour));
        painter.circle_filled(at, DISC, colour);
    } else {
        painter.circle_filled(at, DISC, colour.gamma_multiply(0.35));
        painter.circle_stroke(at, DISC, Stroke::new(1.5, colour));
    }
    if is_hovered {
        painter.circle_stroke(at, DISC + 1.0, Stroke::new(2.0, ui.visuals().strong_text_color()));
    }
    if end.is_positive || is_hovered {
        let letters = if end.is_positive { end.name().split_off(1) } else { end.name() };
        let ink = if end.is_positive { Color32::BLACK } else { ui.visuals().strong_text_color() };
        painter.text(at, Align2::CENTER_CENTER, letters, FontId::proportional(12.0), ink);
    }
}

/// Red, green, blue, as everywhere; darker where it points away.
fn colour_of(end: &End) -> Color32 {
    let bright = [[232, 84, 88], [122, 190, 70], [80, 150, 240]][end.axis];
    let light = 0.78 + 0.22 * end.nearness;
    let [r, g, b] = bright.map(|channel| (f64::from(channel) * light) as u8);
    Color32::from_rgb(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    #[test]
    fn every_end_is_the_side_that_it_points_to() {
        for up in [UpAxis::Y, UpAxis::Z] {
            for end in ends(DQuat::IDENTITY) {
                let outward = End::direction(end.axis, end.is_positive);
                let view = end.view(up);
                assert!(
                    (view.orientation(up) * DVec3::Z - outward).length() < 1e-12,
                    "{} {up:?}",
                    end.name()
                );
            }
        }
    }

    #[test]
    fn the_nearest_end_is_painted_last() {
        let turned = StandardView::Right.orientation(UpAxis::Y);
        let ends = ends(turned);
        assert_eq!((ends[5].name(), ends[0].name()), ("+X".to_owned(), "-X".to_owned()));
        let up = ends.iter().find(|end| end.name() == "+Y").unwrap();
        assert!((up.offset - Vec2::new(0.0, -ARM)).length() < 1e-4);
    }

    struct State {
        turned: DQuat,
        events: Vec<GizmoEvent>,
    }

    fn harness() -> Harness<'static, State> {
        let state = State { turned: StandardView::Iso.orientation(UpAxis::Z), events: Vec::new() };
        Harness::builder().with_size([400.0, 300.0]).build_ui_state(
            |ui, state: &mut State| {
                let picture = ui.max_rect();
                state.events.extend(show(ui, picture, state.turned, UpAxis::Z));
            },
            state,
        )
    }

    #[test]
    fn a_click_on_an_axis_looks_from_there() {
        for (end, view) in [
            ("+X", StandardView::Right),
            ("-X", StandardView::Left),
            ("-Y", StandardView::Front),
            ("+Y", StandardView::Back),
            ("+Z", StandardView::Top),
            ("-Z", StandardView::Bottom),
        ] {
            let mut harness = harness();
            harness.run();
            harness.get_by_label(&format!("View from {end}")).click();
            harness.run();
            assert_eq!(harness.state().events, [GizmoEvent::View(view)], "{end}");
        }
    }

    #[test]
    fn dragging_on_it_orbits_and_clicks_nothing() {
        let mut harness = harness();
        harness.run();
        let from = harness.get_by_label("View from +Z").rect().center();
        let to = from + Vec2::new(-30.0, 12.0);
        harness.hover_at(from);
        harness.drag_at(from);
        harness.step();
        harness.hover_at(from + Vec2::new(-10.0, 2.0));
        harness.step();
        harness.hover_at(to);
        harness.step();
        harness.drop_at(to);
        harness.run();
        let mut sum = Vec2::ZERO;
        for event in &harness.state().events {
            let GizmoEvent::Orbit(by) = event else { panic!("{event:?}") };
            sum += *by;
        }
        assert_eq!(sum, to - from);
    }

    #[test]
    fn a_picture_that_is_too_small_has_none() {
        let mut harness = Harness::builder().with_size([90.0, 300.0]).build_ui(|ui| {
            let picture = ui.max_rect();
            assert_eq!(show(ui, picture, DQuat::IDENTITY, UpAxis::Y), None);
        });
        harness.run();
        assert!(harness.query_by_label("View from +X").is_none());
    }
}
