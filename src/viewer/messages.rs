//! What the viewer says to the user: news that goes by itself, and failures that stay until they were seen.

use egui::{Align2, Area, Color32, Frame, Id, RichText, Stroke};

/// News stays so long, in seconds.
const NEWS_SECONDS: f64 = 5.0;
/// No more than these are shown at once.
const MOST: usize = 6;

#[derive(Debug, Clone, PartialEq)]
struct Message {
    text: String,
    is_failure: bool,
    /// The interface's time at which it was first shown.
    shown_at: Option<f64>,
}

/// All that is to be said.
#[derive(Debug, Clone, Default)]
pub struct Messages(Vec<Message>);

impl Messages {
    /// Says something.
    pub fn say(&mut self, text: impl Into<String>) {
        self.add(text.into(), false);
    }

    /// Says that something went wrong, and what to do.
    pub fn fail(&mut self, text: impl Into<String>) {
        self.add(text.into(), true);
    }

    fn add(&mut self, text: String, is_failure: bool) {
        self.0.retain(|message| message.text != text);
        if self.0.len() == MOST {
            self.0.remove(0);
        }
        self.0.push(Message { text, is_failure, shown_at: None });
    }

    /// What is being said, the oldest first.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|message| message.text.as_str())
    }

    /// Shows them over everything else.
    pub fn show(&mut self, context: &egui::Context) {
        if self.0.is_empty() {
            return;
        }
        let now = context.input(|input| input.time);
        self.0.retain(|message| {
            message.is_failure || message.shown_at.is_none_or(|since| now - since < NEWS_SECONDS)
        });
        let mut seen = None;
        Area::new(Id::unique("messages")).anchor(Align2::CENTER_BOTTOM, [0.0, -36.0]).show(context, |ui| {
            for (number, message) in self.0.iter_mut().enumerate() {
                message.shown_at.get_or_insert(now);
                if row(ui, message) {
                    seen = Some(number);
                }
            }
        });
        if let Some(number) = seen {
            self.0.remove(number);
        }
        if self.0.iter().any(|message| !message.is_failure) {
            context.request_repaint_after(std::time::Duration::from_millis(500));
        }
    }
}

/// One message; says whether it was clicked away.
fn row(ui: &mut egui::Ui, message: &Message) -> bool {
    let colour =
        if message.is_failure { Color32::from_rgb(200, 60, 50) } else { Color32::from_rgb(60, 120, 190) };
    let frame = Frame::popup(ui.style()).stroke(Stroke::new(1.5, colour));
    frame
        .show(ui, |ui| {
            ui.set_max_width(560.0);
            ui.horizontal_wrapped(|ui| {
                ui.label(RichText::new(if message.is_failure { "⚠" } else { "ℹ" }).color(colour));
                ui.label(&message.text);
                ui.small_button("✖").on_hover_text("Seen").clicked()
            })
            .inner
        })
        .inner
}
