//! The picture: the newest frame, and what the mouse does to it.

use egui::{
    Color32, CursorIcon, Event, Key, PointerButton, Pos2, Rect, Response, Sense, Stroke, StrokeKind,
    TextureId, Ui,
};
use glam::DVec2;

use crate::viewer::actions::{self, ENTRIES, Menu};
use crate::viewer::document::Document;
use crate::viewer::mouse::{Action, Button, Gesture, Hand, Modifiers, Preset};
use crate::viewer::navigation::{FlyKeys, Input};
use crate::viewer::painter::Purpose;

/// What the mouse is for just now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tool {
    /// Selects, and moves the camera.
    #[default]
    Hand,
    /// Walks with keys; the mouse looks round.
    Fly,
    /// Picks points to measure.
    Measure,
}

/// The picture, and the hand over it.
#[derive(Debug, Clone)]
pub struct PicturePanel {
    hand: Hand,
    /// Where the frame that selects began.
    frame_from: Option<DVec2>,
    area: Rect,
    /// Pixels of the picture that a unit of the interface covers.
    scale: f64,
}

impl Default for PicturePanel {
    fn default() -> Self {
        Self { hand: Hand::new(Preset::Plain), frame_from: None, area: Rect::NOTHING, scale: 1.0 }
    }
}

/// What a right click on the picture offers: what is done to what is selected.
fn menu(ui: &mut Ui) -> Option<actions::Action> {
    let offered = ENTRIES
        .iter()
        .filter(|entry| entry.menu == Menu::Edit || entry.action == actions::Action::FitSelection);
    let mut chosen = None;
    for entry in offered {
        if ui.add(entry.button(ui.ctx())).clicked() {
            chosen = Some(entry.action);
            ui.close();
        }
    }
    chosen
}

/// Steps of the wheel in the interface's units of scrolling.
const SCROLL_STEP: f64 = 50.0;

impl PicturePanel {
    /// Shows the picture and moves the camera; gives the area that it covers, and what was chosen in the menu of a right click.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        document: &mut Document,
        texture: Option<TextureId>,
        (tool, preset): (Tool, Preset),
    ) -> (Rect, Option<actions::Action>) {
        let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let scale = ui.ctx().pixels_per_point();
        (self.area, self.scale, self.hand.preset) = (area, f64::from(scale), preset);
        document.resize([area.width(), area.height()].map(|side| (side * scale).round().max(1.0) as u32));
        paint(ui, area, texture);
        self.gestures(ui, &response, document, tool);
        self.wheel(ui, &response, document, tool);
        self.hover(ui, &response, document);
        if tool == Tool::Fly {
            fly(ui, document);
        }
        if tool == Tool::Measure && response.hovered() {
            ui.ctx().set_cursor_icon(CursorIcon::Crosshair);
        }
        response.widget_info(|| {
            egui::WidgetInfo::labeled(egui::accesskit::Role::Image, true, "Picture of the model")
        });
        let mut chosen = None;
        response.context_menu(|ui| chosen = menu(ui));
        (area, chosen)
    }

    fn pixel(&self, at: Pos2) -> DVec2 {
        let offset = at - self.area.min;
        DVec2::new(f64::from(offset.x), f64::from(offset.y)) * self.scale
    }

    fn point(&self, pixel: DVec2) -> Pos2 {
        self.area.min + egui::vec2((pixel.x / self.scale) as f32, (pixel.y / self.scale) as f32)
    }

    /// Turns what the buttons did into gestures, and gestures into motions.
    fn gestures(&mut self, ui: &Ui, response: &Response, document: &mut Document, tool: Tool) {
        let events = ui.input(|input| input.events.clone());
        for event in events {
            let gestures = match event {
                Event::PointerButton { pos, button, pressed: true, modifiers, .. } => match button_of(button)
                {
                    Some(button) if response.contains_pointer() => {
                        self.hand.press(button, self.pixel(pos), modifiers_of(modifiers))
                    }
                    _ => Vec::new(),
                },
                Event::PointerButton { pos, button, pressed: false, .. } => match button_of(button) {
                    Some(button) => self.hand.release(button, self.pixel(pos)),
                    None => Vec::new(),
                },
                Event::PointerMoved(pos) => self.hand.moved(self.pixel(pos)),
                Event::WindowFocused(false) => self.hand.cancel(),
                _ => Vec::new(),
            };
            for gesture in gestures {
                self.take(gesture, response, document, tool);
            }
        }
        self.paint_frame(ui);
    }

    fn take(&mut self, gesture: Gesture, response: &Response, document: &mut Document, tool: Tool) {
        match gesture {
            Gesture::Began { action: Action::Select, at } => self.frame_from = Some(at),
            Gesture::Began { at, .. } => {
                document.navigation.begin(document.hovered.map(|pick| pick.point));
                document.pick(whole(at, document.size), Purpose::Grab);
            }
            Gesture::Dragged { action, from, to } => {
                if let Some(input) = input_of(action, tool, from, to) {
                    let picture = document.picture();
                    document.navigation.apply(input, picture);
                }
            }
            Gesture::Ended { action: Action::Select } => {
                if let (Some(from), Some(to)) = (self.frame_from.take(), response.interact_pointer_pos()) {
                    document.select_in_frame(from, self.pixel(to));
                }
            }
            Gesture::Ended { .. } => {}
            Gesture::Clicked { button: Button::Left, at, modifiers } => {
                let pixel = whole(at, document.size);
                if tool == Tool::Measure {
                    return document.measure_at(pixel);
                }
                document.pick(pixel, purpose_of(modifiers, response.double_clicked()));
            }
            Gesture::Clicked { .. } => {}
        }
    }

    /// The frame that selects, while it is drawn.
    fn paint_frame(&self, ui: &Ui) {
        let to = ui.input(|input| input.pointer.latest_pos());
        if let (Some(from), Some(to)) = (self.frame_from, to) {
            let colour = ui.visuals().selection.stroke.color;
            let rect = Rect::from_two_pos(self.point(from), to).intersect(self.area);
            ui.painter().rect_filled(rect, 0.0, colour.gamma_multiply(0.1));
            ui.painter().rect_stroke(rect, 0.0, Stroke::new(1.0, colour), StrokeKind::Inside);
        }
    }

    fn wheel(&self, ui: &Ui, response: &Response, document: &mut Document, tool: Tool) {
        let Some(at) = response.hover_pos() else { return };
        let (scrolled, pinched) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
        let forward = self.hand.preset.nearer_steps(f64::from(scrolled) / SCROLL_STEP, false);
        let steps = forward + f64::from(pinched).ln() / 1.2f64.ln();
        if steps == 0.0 {
            return;
        }
        if tool == Tool::Fly {
            return document.navigation.change_fly_speed(steps);
        }
        let picked = document.hovered.map(|pick| pick.point);
        let input = Input::Zoom { at: self.pixel(at), steps, picked };
        let picture = document.picture();
        document.navigation.apply(input, picture);
    }

    /// Asks for what is under the pointer when it has moved.
    fn hover(&self, ui: &Ui, response: &Response, document: &mut Document) {
        match response.hover_pos() {
            Some(at) if !self.hand.is_holding() => {
                if ui.input(|input| input.pointer.delta() != egui::Vec2::ZERO) {
                    document.pick(whole(self.pixel(at), document.size), Purpose::Hover);
                }
            }
            Some(_) => {}
            None => document.point_at_nothing(),
        }
    }
}

fn paint(ui: &Ui, area: Rect, texture: Option<TextureId>) {
    match texture {
        Some(texture) => {
            let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            ui.painter().image(texture, area, whole, Color32::WHITE);
        }
        None => drop(ui.painter().rect_filled(area, 0.0, Color32::from_gray(200))),
    }
}

/// The pixel that a point is in.
fn whole(at: DVec2, size: [u32; 2]) -> [u32; 2] {
    let at = at.max(DVec2::ZERO);
    [(at.x as u32).min(size[0].saturating_sub(1)), (at.y as u32).min(size[1].saturating_sub(1))]
}

fn button_of(button: PointerButton) -> Option<Button> {
    match button {
        PointerButton::Primary => Some(Button::Left),
        PointerButton::Middle => Some(Button::Middle),
        PointerButton::Secondary => Some(Button::Right),
        _ => None,
    }
}

fn modifiers_of(modifiers: egui::Modifiers) -> Modifiers {
    Modifiers { shift: modifiers.shift, ctrl: modifiers.command, alt: modifiers.alt }
}

fn purpose_of(modifiers: Modifiers, is_double: bool) -> Purpose {
    if is_double {
        Purpose::Fit
    } else if modifiers.alt {
        Purpose::Cut
    } else if modifiers.ctrl || modifiers.shift {
        Purpose::SelectMore
    } else {
        Purpose::Select
    }
}

/// What dragging does to the camera.
fn input_of(action: Action, tool: Tool, from: DVec2, to: DVec2) -> Option<Input> {
    let by = to - from;
    match action {
        Action::Orbit if tool == Tool::Fly => Some(Input::Look { by }),
        Action::Orbit => Some(Input::Orbit { by }),
        Action::Pan => Some(Input::Pan { by }),
        Action::Zoom => Some(Input::ZoomDrag { by }),
        Action::Roll => Some(Input::Roll { from, to }),
        Action::Select => None,
    }
}

fn fly(ui: &Ui, document: &mut Document) {
    if ui.ctx().egui_wants_keyboard_input() {
        return;
    }
    let (keys, seconds) = ui.input(|input| {
        let down = |key| input.key_down(key);
        let keys = FlyKeys {
            forward: down(Key::W),
            back: down(Key::S),
            left: down(Key::A),
            right: down(Key::D),
            up: down(Key::E),
            down: down(Key::Q),
            fast: input.modifiers.shift,
        };
        (keys, input.stable_dt)
    });
    if document.navigation.fly(keys, f64::from(seconds)) {
        ui.ctx().request_repaint();
    }
}
