//! What the viewer says to the user: news that goes by itself, and failures that stay until they were seen or what failed
//! has been done after all.

use egui::{Align2, Area, Color32, Frame, Id, RichText, Stroke};

/// News stays so long, in seconds.
const NEWS_SECONDS: f64 = 5.0;
/// No more than these are shown at once.
const MOST: usize = 6;

/// What a failure was in the way of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Attempt {
    /// Opening a model.
    Open,
    /// Writing a picture or a path.
    Save,
    /// Something that is not asked for again.
    Other,
}

#[derive(Debug, Clone, PartialEq)]
struct Message {
    text: String,
    /// What did not come about; `None` in news.
    failed: Option<Attempt>,
    /// The interface's time at which it was first shown.
    shown_at: Option<f64>,
}

/// All that is to be said.
#[derive(Debug, Clone, Default)]
pub struct Messages(Vec<Message>);

impl Messages {
    /// Says something.
    pub fn say(&mut self, text: impl Into<String>) {
        self.add(text.into(), None);
    }

    /// Says that something went wrong, and what to do.
    pub fn fail(&mut self, attempt: Attempt, text: impl Into<String>) {
        self.add(text.into(), Some(attempt));
    }

    /// What was attempted has succeeded: what is said of earlier failures of it goes.
    pub fn done(&mut self, attempt: Attempt) {
        self.0.retain(|message| message.failed != Some(attempt));
    }

    fn add(&mut self, text: String, failed: Option<Attempt>) {
        self.0.retain(|message| message.text != text);
        if self.0.len() == MOST {
            self.0.remove(0);
        }
        self.0.push(Message { text, failed, shown_at: None });
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
            message.failed.is_some() || message.shown_at.is_none_or(|since| now - since < NEWS_SECONDS)
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
        if self.0.iter().any(|message| message.failed.is_none()) {
            context.request_repaint_after(std::time::Duration::from_millis(500));
        }
    }
}

/// One message; says whether it was clicked away.
fn row(ui: &mut egui::Ui, message: &Message) -> bool {
    let (sign, colour) = match message.failed {
        Some(_) => ("⚠", Color32::from_rgb(200, 60, 50)),
        None => ("ℹ", Color32::from_rgb(60, 120, 190)),
    };
    let frame = Frame::popup(ui.style()).stroke(Stroke::new(1.5, colour));
    frame
        .show(ui, |ui| {
            ui.set_max_width(560.0);
            ui.horizontal_wrapped(|ui| {
                ui.label(RichText::new(sign).color(colour));
                ui.label(&message.text);
                ui.small_button("✖").on_hover_text("Seen").clicked()
            })
            .inner
        })
        .inner
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_is_said_until_what_failed_is_done() {
        let mut messages = Messages::default();
        messages.fail(Attempt::Open, "cannot open a");
        messages.fail(Attempt::Save, "cannot write b");
        messages.fail(Attempt::Other, "cannot read the settings");
        messages.say("Saved c");
        messages.done(Attempt::Open);
        let said: Vec<_> = messages.texts().collect();
        assert_eq!(said, ["cannot write b", "cannot read the settings", "Saved c"]);
    }
}
