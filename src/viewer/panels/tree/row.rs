//! An item in, its row out: eye, arrow, name and counts, all painted, and what the user did to it.

use egui::text::{LayoutJob, TextFormat, TextWrapping};
use egui::{Color32, FontSelection, Galley, Id, Modifiers, Pos2, Rect, Response, Role, Sense, Shape, Stroke};
use egui::{TextStyle, Ui, Vec2, WidgetInfo};
use std::sync::Arc;

use super::super::super::visibility::Share;
use super::{TreeEvent, TreeModel, menu};
use crate::stats::report::human;

/// The height of a row in points. Even, so that the places of rows are exact in `f32` up to 1.6 million rows.
pub(super) const ROW_HEIGHT: f32 = 20.0;
/// The width of the eye and of the arrow, and how much deeper each level starts.
const ICON: f32 = 18.0;
const INDENT: f32 = 14.0;
/// Levels beyond this share of the width start where the last before does.
const MOST_INDENT: f32 = 0.4;
/// No more of a name is laid out.
const MOST_CHARS: usize = 200;

/// What the user did to a row.
#[derive(Debug)]
pub(super) enum RowDeed {
    Arrow,
    Eye,
    Click(Modifiers),
    DoubleClick,
    SecondaryClick,
    ExpandBelow,
    CollapseAll,
    Event(TreeEvent),
}

/// What came of a row.
pub(super) struct Shown {
    pub deed: Option<RowDeed>,
    /// Whether the pointer is over it, and not busy elsewhere.
    pub is_pointed_at: bool,
}

/// Draws one row below the last.
pub(super) fn show(ui: &mut Ui, list: Id, model: &TreeModel<'_>, item: u32, is_cursor: bool) -> Shown {
    let (_, rect) = ui.allocate_space(Vec2::new(ui.available_width(), ROW_HEIGHT));
    let name = model.name(item);
    let row = ui.interact(rect, list.with(("row", item)), Sense::CLICK);
    let share = model.visibility.selected_share(item);
    row.widget_info(|| WidgetInfo::selected(Role::TreeItem, true, share == Share::All, &name));
    let is_pointed_at = row.hovered() || ui.rect_contains_pointer(rect) && !ui.ctx().egui_is_using_pointer();
    let leaf = model.tree.assembly().leaf_of_item(item);
    let is_hovered = is_pointed_at || leaf.is_some() && leaf == model.visibility.hovered_leaf();
    paint_background(ui, row.rect, share, (is_hovered, is_cursor));

    let eye = Rect::from_min_size(rect.min, Vec2::new(ICON, ROW_HEIGHT));
    let indent = (model.tree.assembly().depth(item) as f32 * INDENT).min(rect.width() * MOST_INDENT);
    let arrow = eye.translate(Vec2::new(ICON + indent, 0.0));
    paint_texts(ui, model, item, &name, Rect::from_min_max(Pos2::new(arrow.max.x, rect.min.y), rect.max));
    let eye = show_eye(ui, list, model, item, &name, eye);
    let arrow = show_arrow(ui, list, model, item, &name, arrow);

    let mut from_menu = None;
    row.context_menu(|ui| from_menu = menu::show(ui, model, item));
    let row = row.on_hover_ui(|ui| _ = ui.label(summary(model, item, &name)));
    Shown { deed: from_menu.or_else(|| deed(ui, &row, eye, arrow)), is_pointed_at }
}

fn deed(ui: &Ui, row: &Response, eye: bool, arrow: bool) -> Option<RowDeed> {
    if eye {
        Some(RowDeed::Eye)
    } else if arrow {
        Some(RowDeed::Arrow)
    } else if row.double_clicked() {
        Some(RowDeed::DoubleClick)
    } else if row.clicked() {
        Some(RowDeed::Click(ui.input(|input| input.modifiers)))
    } else if row.secondary_clicked() {
        Some(RowDeed::SecondaryClick)
    } else {
        None
    }
}

fn paint_background(ui: &Ui, rect: Rect, share: Share, (is_hovered, is_cursor): (bool, bool)) {
    let visuals = ui.visuals();
    let fill = match share {
        Share::All => visuals.selection.bg_fill,
        _ if is_hovered => visuals.widgets.hovered.weak_bg_fill,
        Share::Some => visuals.selection.bg_fill.gamma_multiply(0.25),
        Share::None => Color32::TRANSPARENT,
    };
    ui.painter().rect_filled(rect, 2.0, fill);
    if is_hovered && share == Share::All {
        let stroke = Stroke::new(1.0, visuals.widgets.hovered.bg_stroke.color);
        ui.painter().rect_stroke(rect, 2.0, stroke, egui::StrokeKind::Inside);
    }
    if is_cursor {
        let stroke = Stroke::new(1.0, visuals.selection.stroke.color);
        ui.painter().rect_stroke(rect, 2.0, stroke, egui::StrokeKind::Inside);
    }
}

fn paint_texts(ui: &Ui, model: &TreeModel<'_>, item: u32, name: &str, rect: Rect) {
    let visuals = ui.visuals();
    let is_faint =
        model.visibility.shown_share(item) == Share::None || model.visibility.ghost_share(item) == Share::All;
    let colour = match (model.visibility.selected_share(item), is_faint) {
        (Share::All, _) => visuals.selection.stroke.color,
        (_, true) => visuals.weak_text_color(),
        _ => visuals.text_color(),
    };
    let counts = galley(ui, &counts(model, item), visuals.weak_text_color(), TextStyle::Small, rect.width());
    let room = (rect.width() - counts.size().x - 12.0).max(0.0);
    let place = |galley: &Galley, x| Pos2::new(x, rect.center().y - galley.size().y / 2.0);
    // Where there is room for one only, it is the name.
    let has_room = room > 24.0;
    let name = galley(ui, name, colour, TextStyle::Body, if has_room { room } else { rect.width() });
    ui.painter().galley(place(&name, rect.min.x + 2.0), name, colour);
    if has_room {
        ui.painter().galley(place(&counts, rect.max.x - counts.size().x - 4.0), counts, colour);
    }
}

fn galley(ui: &Ui, text: &str, colour: Color32, style: TextStyle, width: f32) -> Arc<Galley> {
    let text = text.char_indices().nth(MOST_CHARS).map_or(text, |(end, _)| &text[..end]);
    let font = FontSelection::Style(style).resolve(ui.style());
    let mut job = LayoutJob::single_section(text.to_owned(), TextFormat::simple(font, colour));
    job.wrap = TextWrapping::truncate_at_width(width.max(0.0));
    job.break_on_newline = false;
    ui.painter().layout_job(job)
}

/// Instances and triangles below an item; of a leaf only triangles.
fn counts(model: &TreeModel<'_>, item: u32) -> String {
    let below = model.tree.assembly().below(item);
    match model.tree.assembly().leaf_of_item(item) {
        Some(_) => short(below.triangles),
        None => format!("{} · {}", human::count(below.instances), short(below.triangles)),
    }
}

fn summary(model: &TreeModel<'_>, item: u32, name: &str) -> String {
    let below = model.tree.assembly().below(item);
    let [instances, triangles] = [below.instances, below.triangles].map(human::count);
    let noun = if below.instances == 1 { "instance" } else { "instances" };
    format!("{name}: {instances} {noun}, {triangles} triangles")
}

/// A count with three digits and a unit: `812`, `4.20 k`, `332 M`.
fn short(number: u64) -> String {
    const UNITS: [&str; 5] = ["k", "M", "G", "T", "P"];
    let mut value = number as f64;
    let mut unit = None;
    // 999.5 would be written as 1000.
    while value >= 999.5 && unit != Some(UNITS.len() - 1) {
        value /= 1000.0;
        unit = Some(unit.map_or(0, |unit| unit + 1));
    }
    let decimals = if value < 9.995 { 2 } else { usize::from(value < 99.95) };
    unit.map_or(number.to_string(), |unit| format!("{value:.decimals$} {}", UNITS[unit]))
}

fn show_arrow(ui: &Ui, list: Id, model: &TreeModel<'_>, item: u32, name: &str, rect: Rect) -> bool {
    if !model.tree.can_expand(item) {
        return false;
    }
    let is_open = model.tree.is_expanded(item);
    let response = ui.interact(rect, list.with(("arrow", item)), Sense::CLICK);
    let word = if is_open { "collapse" } else { "expand" };
    response.widget_info(|| WidgetInfo::labeled(Role::DisclosureTriangle, true, format!("{word} {name}")));
    let turn = if is_open { Vec2::new(0.0, 1.0) } else { Vec2::new(1.0, 0.0) };
    let (ahead, aside) = (turn * 3.5, turn.rot90() * 4.0);
    let corners = [ahead, aside - ahead, -aside - ahead].map(|to| rect.center() + to);
    let colour = ui.style().interact(&response).fg_stroke.color;
    ui.painter().add(Shape::convex_polygon(corners.to_vec(), colour, Stroke::NONE));
    response.clicked()
}

fn show_eye(ui: &Ui, list: Id, model: &TreeModel<'_>, item: u32, name: &str, rect: Rect) -> bool {
    if model.tree.assembly().leaves_of(item).is_empty() {
        return false;
    }
    let share = model.visibility.shown_share(item);
    let response = ui.interact(rect, list.with(("eye", item)), Sense::CLICK);
    let label = format!("show {name}");
    response.widget_info(|| match share {
        Share::All => WidgetInfo::selected(Role::CheckBox, true, true, &label),
        Share::None => WidgetInfo::selected(Role::CheckBox, true, false, &label),
        Share::Some => WidgetInfo::labeled(Role::CheckBox, true, &label),
    });
    let colour = match (response.hovered(), share) {
        (true, _) => ui.visuals().strong_text_color(),
        (false, Share::None) => ui.visuals().weak_text_color().gamma_multiply(0.6),
        (false, _) => ui.visuals().text_color(),
    };
    paint_eye(ui, rect.center(), share, colour);
    response.clicked()
}

/// An open eye; without pupil where only some is shown; closed where nothing is.
fn paint_eye(ui: &Ui, centre: Pos2, share: Share, colour: Color32) {
    let stroke = Stroke::new(1.2, colour);
    let lid = |up: f32| {
        let points = (0..=8).map(move |i| {
            let x = i as f32 / 4.0 - 1.0;
            centre + Vec2::new(6.0 * x, up * 3.6 * (1.0 - x * x))
        });
        points.collect::<Vec<_>>()
    };
    ui.painter().add(Shape::line(lid(1.0), stroke));
    match share {
        Share::None => {}
        Share::Some => {
            ui.painter().add(Shape::line(lid(-1.0), stroke));
            ui.painter().circle_stroke(centre, 1.6, Stroke::new(1.0, colour));
        }
        Share::All => {
            ui.painter().add(Shape::line(lid(-1.0), stroke));
            ui.painter().circle_filled(centre, 2.2, colour);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_counts_have_three_digits() {
        let numbers = [0, 7, 812, 999, 1_000, 4_199, 99_949, 99_950, 999_499, 999_500, 332_000_000, u64::MAX];
        let texts = numbers.map(short);
        let expected = [
            "0", "7", "812", "999", "1.00 k", "4.20 k", "99.9 k", "100 k", "999 k", "1.00 M", "332 M",
            "18447 P",
        ];
        assert_eq!(texts, expected);
    }
}
