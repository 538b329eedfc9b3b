//! Buttons, modifiers and the wheel in, what they mean in the hands of a CAD user out.
//!
//! A [`Preset`] is a table of [`Binding`]s, which the key sheet shows as it stands; [`Hand`] follows presses, releases and
//! motions and says what to do. The tables are those that the programs document. Where Fusion 360 and Inventor agree they
//! are one preset. In CATIA the wheel scrolls, which a picture of a model has no use for; here it zooms.

use glam::DVec2;
use serde::{Deserialize, Serialize};

/// A button of the mouse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Button {
    /// The left one.
    Left,
    /// The middle one, or the wheel pressed.
    Middle,
    /// The right one.
    Right,
}

impl Button {
    fn bit(self) -> u8 {
        match self {
            Self::Left => 1,
            Self::Middle => 2,
            Self::Right => 4,
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Middle => "middle",
            Self::Right => "right",
        }
    }
}

/// The modifier keys that are down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Modifiers {
    /// Shift.
    pub shift: bool,
    /// Control, or command on a Mac.
    pub ctrl: bool,
    /// Alt, or option on a Mac.
    pub alt: bool,
}

impl Modifiers {
    /// None.
    pub const NONE: Self = Self { shift: false, ctrl: false, alt: false };
    const SHIFT: Self = Self { shift: true, ..Self::NONE };
    const CTRL: Self = Self { ctrl: true, ..Self::NONE };
    const ALT: Self = Self { alt: true, ..Self::NONE };
    const CTRL_SHIFT: Self = Self { shift: true, ctrl: true, alt: false };

    fn words(self) -> impl Iterator<Item = &'static str> {
        [(self.ctrl, "Ctrl"), (self.shift, "Shift"), (self.alt, "Alt")]
            .into_iter()
            .filter_map(|(down, word)| down.then_some(word))
    }
}

/// What dragging does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Turn about the point under the cursor.
    Orbit,
    /// Move the picture.
    Pan,
    /// Come nearer or go away.
    Zoom,
    /// Turn the picture.
    Roll,
    /// Select with a frame.
    Select,
}

impl Action {
    /// What the key sheet calls it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Orbit => "Orbit",
            Self::Pan => "Pan",
            Self::Zoom => "Zoom",
            Self::Roll => "Roll",
            Self::Select => "Select in a frame",
        }
    }
}

/// What is held down, and what dragging does then.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Binding {
    /// Buttons held together.
    pub buttons: &'static [Button],
    /// Modifiers, exactly these.
    pub modifiers: Modifiers,
    /// What dragging does.
    pub action: Action,
    /// A last button that is let go again before dragging, the others still being held.
    pub tapped: Option<Button>,
}

const fn drag(buttons: &'static [Button], modifiers: Modifiers, action: Action) -> Binding {
    Binding { buttons, modifiers, action, tapped: None }
}

const fn after_tap(buttons: &'static [Button], tapped: Button, action: Action) -> Binding {
    Binding { buttons, modifiers: Modifiers::NONE, action, tapped: Some(tapped) }
}

impl Binding {
    /// Words for the key sheet: `Ctrl + middle`.
    pub fn describe(&self) -> String {
        let held: Vec<&str> =
            self.modifiers.words().chain(self.buttons.iter().map(|button| button.word())).collect();
        match self.tapped {
            Some(tapped) => format!("{} drag after a click of {}", held.join(" + "), tapped.word()),
            None => format!("{} drag", held.join(" + ")),
        }
    }

    fn bits(&self) -> u8 {
        self.buttons.iter().fold(0, |bits, button| bits | button.bit())
    }
}

/// Whose habits the mouse follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The left button turns, as in most viewers.
    #[default]
    Plain,
    /// SolidWorks.
    SolidWorks,
    /// CATIA.
    Catia,
    /// Fusion 360 and Inventor.
    Fusion,
    /// NX.
    Nx,
}

use Action::{Orbit, Pan, Roll, Select, Zoom};
use Button::{Left, Middle, Right};

const PLAIN: &[Binding] = &[
    drag(&[Left], Modifiers::NONE, Orbit),
    drag(&[Middle], Modifiers::NONE, Pan),
    drag(&[Left], Modifiers::SHIFT, Pan),
    drag(&[Right], Modifiers::NONE, Zoom),
    drag(&[Left], Modifiers::CTRL, Roll),
    drag(&[Left], Modifiers::ALT, Select),
];

const SOLID_WORKS: &[Binding] = &[
    drag(&[Middle], Modifiers::NONE, Orbit),
    drag(&[Middle], Modifiers::CTRL, Pan),
    drag(&[Middle], Modifiers::SHIFT, Zoom),
    drag(&[Middle], Modifiers::ALT, Roll),
    drag(&[Left], Modifiers::NONE, Select),
];

const CATIA: &[Binding] = &[
    drag(&[Middle, Left], Modifiers::NONE, Orbit),
    drag(&[Middle, Right], Modifiers::NONE, Orbit),
    drag(&[Middle], Modifiers::NONE, Pan),
    after_tap(&[Middle], Left, Zoom),
    after_tap(&[Middle], Right, Zoom),
    drag(&[Middle], Modifiers::CTRL, Zoom),
    drag(&[Left], Modifiers::NONE, Select),
];

const FUSION: &[Binding] = &[
    drag(&[Middle], Modifiers::SHIFT, Orbit),
    drag(&[Middle], Modifiers::NONE, Pan),
    drag(&[Middle], Modifiers::CTRL_SHIFT, Zoom),
    drag(&[Left], Modifiers::NONE, Select),
];

const NX: &[Binding] = &[
    drag(&[Middle], Modifiers::NONE, Orbit),
    drag(&[Middle, Right], Modifiers::NONE, Pan),
    drag(&[Middle], Modifiers::SHIFT, Pan),
    drag(&[Left, Middle], Modifiers::NONE, Zoom),
    drag(&[Middle], Modifiers::CTRL, Zoom),
    drag(&[Left], Modifiers::NONE, Select),
];

impl Preset {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Plain, Self::SolidWorks, Self::Catia, Self::Fusion, Self::Nx];

    /// What the settings call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "Plain",
            Self::SolidWorks => "SolidWorks",
            Self::Catia => "CATIA",
            Self::Fusion => "Fusion 360, Inventor",
            Self::Nx => "NX",
        }
    }

    /// What dragging does.
    pub fn bindings(self) -> &'static [Binding] {
        match self {
            Self::Plain => PLAIN,
            Self::SolidWorks => SOLID_WORKS,
            Self::Catia => CATIA,
            Self::Fusion => FUSION,
            Self::Nx => NX,
        }
    }

    /// Whether rolling the wheel away from oneself comes nearer, unless the settings reverse it.
    pub fn wheel_forward_is_nearer(self) -> bool {
        !matches!(self, Self::SolidWorks | Self::Fusion)
    }

    /// Steps to come nearer that a roll of the wheel away from oneself stands for.
    pub fn nearer_steps(self, forward_steps: f64, is_reversed: bool) -> f64 {
        if self.wheel_forward_is_nearer() == is_reversed { -forward_steps } else { forward_steps }
    }

    /// What the key sheet shows: what the hand does, and what that does.
    pub fn sheet(self, is_reversed: bool) -> Vec<(String, &'static str)> {
        let wheel = match self.nearer_steps(1.0, is_reversed) > 0.0 {
            true => "Nearer to the cursor",
            false => "Away from the cursor",
        };
        let fixed = [
            ("left click", "Select what is under the cursor"),
            ("Ctrl + left click", "Add to the selection, or take from it"),
            ("left double click", "Fit what is under the cursor"),
            ("right click", "Menu"),
            ("wheel forward", wheel),
        ];
        let drags = self.bindings().iter().map(|binding| (binding.describe(), binding.action.word()));
        drags.chain(fixed.map(|(hand, what)| (hand.to_owned(), what))).collect()
    }

    fn action(self, held: u8, modifiers: Modifiers, tapped: Option<Button>) -> Option<Action> {
        let fits = |binding: &&Binding| binding.bits() == held && binding.modifiers == modifiers;
        let all = || self.bindings().iter().filter(fits);
        let exact = all().find(|binding| binding.tapped.is_some() && binding.tapped == tapped);
        exact.or_else(|| all().find(|binding| binding.tapped.is_none())).map(|binding| binding.action)
    }
}

/// The hand moves so many pixels before a press becomes a drag.
const DRAG_PIXELS: f64 = 4.0;

/// What the hand did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gesture {
    /// A drag began, or became another one; the hand took hold at `at`.
    Began {
        /// What it does.
        action: Action,
        /// Where the button was pressed.
        at: DVec2,
    },
    /// The hand went from one pixel to another.
    Dragged {
        /// What it does.
        action: Action,
        /// Where it was.
        from: DVec2,
        /// Where it is.
        to: DVec2,
    },
    /// The drag is over.
    Ended {
        /// What it did.
        action: Action,
    },
    /// A button was pressed and let go in one place.
    Clicked {
        /// The button.
        button: Button,
        /// Where.
        at: DVec2,
        /// The modifiers at that time.
        modifiers: Modifiers,
    },
}

/// Follows the buttons and the cursor over the picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Hand {
    /// Whose habits it has.
    pub preset: Preset,
    held: u8,
    modifiers: Modifiers,
    /// A button that was let go while others stayed down.
    tapped: Option<Button>,
    pressed_at: DVec2,
    at: DVec2,
    /// Whether the cursor has left the place of the press, or more than one button was down.
    is_dragging: bool,
    action: Option<Action>,
}

impl Hand {
    /// A hand with nothing pressed.
    pub fn new(preset: Preset) -> Self {
        Self {
            preset,
            held: 0,
            modifiers: Modifiers::NONE,
            tapped: None,
            pressed_at: DVec2::ZERO,
            at: DVec2::ZERO,
            is_dragging: false,
            action: None,
        }
    }

    /// What is being dragged, if anything.
    pub fn action(&self) -> Option<Action> {
        self.action
    }

    /// Whether any button is down.
    pub fn is_holding(&self) -> bool {
        self.held != 0
    }

    /// A button went down over the picture.
    pub fn press(&mut self, button: Button, at: DVec2, modifiers: Modifiers) -> Vec<Gesture> {
        let is_first = self.held == 0;
        self.held |= button.bit();
        (self.modifiers, self.at) = (modifiers, at);
        if is_first {
            (self.pressed_at, self.tapped, self.is_dragging) = (at, None, false);
            return Vec::new();
        }
        // Two buttons together are never a click.
        self.is_dragging = true;
        self.tapped = None;
        self.follow()
    }

    /// A button went up, wherever the cursor is.
    pub fn release(&mut self, button: Button, at: DVec2) -> Vec<Gesture> {
        if self.held & button.bit() == 0 {
            return Vec::new();
        }
        self.held &= !button.bit();
        self.at = at;
        if self.held != 0 {
            self.tapped = Some(button);
            return self.follow();
        }
        let clicked =
            (!self.is_dragging).then_some(Gesture::Clicked { button, at, modifiers: self.modifiers });
        self.end().into_iter().chain(clicked).collect()
    }

    /// The cursor moved.
    pub fn moved(&mut self, to: DVec2) -> Vec<Gesture> {
        let from = std::mem::replace(&mut self.at, to);
        if self.held == 0 {
            return Vec::new();
        }
        if !self.is_dragging && (to - self.pressed_at).length() < DRAG_PIXELS {
            return Vec::new();
        }
        let is_first = !std::mem::replace(&mut self.is_dragging, true);
        let mut gestures = if is_first { self.follow() } else { Vec::new() };
        if let Some(action) = self.action {
            // What the hand went until it was a drag is not lost.
            let from = if is_first { self.pressed_at } else { from };
            gestures.push(Gesture::Dragged { action, from, to });
        }
        gestures
    }

    /// Lets go of everything, as when the window loses the focus.
    pub fn cancel(&mut self) -> Vec<Gesture> {
        self.held = 0;
        self.end().into_iter().collect()
    }

    /// Takes up the action of what is held now.
    fn follow(&mut self) -> Vec<Gesture> {
        let next = self.preset.action(self.held, self.modifiers, self.tapped);
        if next == self.action {
            return Vec::new();
        }
        let ended = self.end();
        self.action = next;
        let at = if self.held.count_ones() == 1 && self.tapped.is_none() { self.pressed_at } else { self.at };
        let began = next.map(|action| Gesture::Began { action, at });
        ended.into_iter().chain(began).collect()
    }

    fn end(&mut self) -> Option<Gesture> {
        self.action.take().map(|action| Gesture::Ended { action })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: DVec2 = DVec2::new(100.0, 100.0);
    const THERE: DVec2 = DVec2::new(130.0, 90.0);

    /// What a drag with these buttons pressed one after another does.
    fn dragged(preset: Preset, buttons: &[Button], modifiers: Modifiers) -> Option<Action> {
        let mut hand = Hand::new(preset);
        for &button in buttons {
            hand.press(button, AT, modifiers);
        }
        hand.moved(THERE);
        hand.action()
    }

    #[test]
    fn the_programs_turn_move_and_zoom_as_their_users_know() {
        use Preset::*;
        let none = Modifiers::NONE;
        for (preset, buttons, modifiers, action) in [
            (Plain, &[Left][..], none, Orbit),
            (Plain, &[Middle], none, Pan),
            (Plain, &[Right], none, Zoom),
            (SolidWorks, &[Middle], none, Orbit),
            (SolidWorks, &[Middle], Modifiers::CTRL, Pan),
            (SolidWorks, &[Middle], Modifiers::SHIFT, Zoom),
            (SolidWorks, &[Middle], Modifiers::ALT, Roll),
            (Catia, &[Middle], none, Pan),
            (Catia, &[Middle, Right], none, Orbit),
            (Catia, &[Middle, Left], none, Orbit),
            (Fusion, &[Middle], none, Pan),
            (Fusion, &[Middle], Modifiers::SHIFT, Orbit),
            (Nx, &[Middle], none, Orbit),
            (Nx, &[Middle, Right], none, Pan),
            (Nx, &[Left, Middle], none, Zoom),
        ] {
            assert_eq!(
                dragged(preset, buttons, modifiers),
                Some(action),
                "{preset:?} {buttons:?} {modifiers:?}"
            );
        }
        assert_eq!(dragged(SolidWorks, &[Middle], Modifiers::CTRL_SHIFT), None);
    }

    #[test]
    fn in_catia_a_click_of_another_button_turns_moving_into_zooming() {
        let mut hand = Hand::new(Preset::Catia);
        assert_eq!(hand.press(Middle, AT, Modifiers::NONE), []);
        assert_eq!(hand.press(Left, AT, Modifiers::NONE), [Gesture::Began { action: Orbit, at: AT }]);
        let began = hand.release(Left, AT);
        assert_eq!(began, [Gesture::Ended { action: Orbit }, Gesture::Began { action: Zoom, at: AT }]);
        assert_eq!(hand.moved(THERE), [Gesture::Dragged { action: Zoom, from: AT, to: THERE }]);
        assert_eq!(hand.release(Middle, THERE), [Gesture::Ended { action: Zoom }], "and no click");
    }

    #[test]
    fn a_press_that_stays_is_a_click_and_one_that_goes_is_a_drag() {
        let mut hand = Hand::new(Preset::Plain);
        hand.press(Left, AT, Modifiers::CTRL);
        assert_eq!(hand.moved(AT + DVec2::X), []);
        let clicked = Gesture::Clicked { button: Left, at: AT + DVec2::X, modifiers: Modifiers::CTRL };
        assert_eq!(hand.release(Left, AT + DVec2::X), [clicked]);
        hand.press(Left, AT, Modifiers::NONE);
        assert_eq!(
            hand.moved(THERE),
            [
                Gesture::Began { action: Orbit, at: AT },
                Gesture::Dragged { action: Orbit, from: AT, to: THERE }
            ]
        );
        assert_eq!(hand.moved(AT), [Gesture::Dragged { action: Orbit, from: THERE, to: AT }]);
        assert_eq!(hand.release(Left, AT), [Gesture::Ended { action: Orbit }]);
        assert_eq!(hand.release(Left, AT), [], "let go twice");
    }

    #[test]
    fn losing_the_focus_lets_go() {
        let mut hand = Hand::new(Preset::SolidWorks);
        hand.press(Middle, AT, Modifiers::NONE);
        hand.moved(THERE);
        assert_eq!(hand.cancel(), [Gesture::Ended { action: Orbit }]);
        assert_eq!(hand.moved(AT), []);
        assert!(!hand.is_holding());
    }

    #[test]
    fn the_wheel_has_a_direction_that_can_be_reversed() {
        assert_eq!(Preset::Plain.nearer_steps(2.0, false), 2.0);
        assert_eq!(Preset::Plain.nearer_steps(2.0, true), -2.0);
        assert_eq!(Preset::SolidWorks.nearer_steps(2.0, false), -2.0);
        assert_eq!(Preset::SolidWorks.nearer_steps(2.0, true), 2.0);
    }

    #[test]
    fn every_preset_can_orbit_pan_and_zoom_says_how_and_contradicts_itself_nowhere() {
        for preset in Preset::ALL {
            let sheet = preset.sheet(false);
            for action in [Orbit, Pan, Zoom] {
                assert!(sheet.iter().any(|row| row.1 == action.word()), "{preset:?} {action:?}");
            }
            let mut hands: Vec<&String> = sheet.iter().map(|row| &row.0).collect();
            hands.sort();
            hands.dedup();
            assert_eq!(hands.len(), sheet.len(), "{preset:?}");
            let name = serde_json::to_string(&preset).unwrap();
            assert_eq!(serde_json::from_str::<Preset>(&name).unwrap(), preset);
        }
        assert_eq!(serde_json::to_string(&Preset::SolidWorks).unwrap(), "\"solid-works\"");
        assert_eq!(SOLID_WORKS[1].describe(), "Ctrl + middle drag");
    }
}
