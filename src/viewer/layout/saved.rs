//! Panels as tiles in, words of JSON out, and back: whatever the words say, what comes of them can be shown.

use egui_tiles::{Container, Linear, LinearDir, Tile, TileId, Tiles, Tree};
use serde::{Deserialize, Serialize};

use super::Pane;

/// Another number is another arrangement, which is not understood.
const VERSION: u32 = 1;
/// Shares of room are within this, whatever was dragged.
const SHARES: std::ops::RangeInclusive<f32> = 1e-3..=1e3;

/// Which panels are where, which of them are in front, and whether any are shown beside the picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Arrangement {
    version: u32,
    pub(super) shows_panels: bool,
    place: Place,
}

/// What is in a part of the window. Lines have a share of the room for each child.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Place {
    Pane(Pane),
    Tabs { front: usize, children: Vec<Place> },
    Row { shares: Vec<f32>, children: Vec<Place> },
    Column { shares: Vec<f32>, children: Vec<Place> },
}

impl Arrangement {
    /// That of tiles; none if there are none.
    pub(super) fn of(tree: &Tree<Pane>, shows_panels: bool) -> Option<Self> {
        Some(Self { version: VERSION, shows_panels, place: place_of(&tree.tiles, tree.root?)? })
    }

    /// The tiles, if each panel is in them once and nothing else is odd.
    pub(super) fn tree(&self) -> Option<Tree<Pane>> {
        let mut panes = Vec::new();
        let is_sound = self.version == VERSION && self.place.is_sound(&mut panes);
        let is_whole = panes.len() == Pane::ALL.len() && Pane::ALL.iter().all(|pane| panes.contains(pane));
        (is_sound && is_whole).then(|| {
            let mut tiles = Tiles::default();
            let root = self.place.put(&mut tiles);
            Tree::new(egui::Id::unique("panels"), root, tiles)
        })
    }
}

fn place_of(tiles: &Tiles<Pane>, id: TileId) -> Option<Place> {
    let places = |ids: &[TileId]| ids.iter().map(|&id| place_of(tiles, id)).collect::<Option<Vec<_>>>();
    Some(match tiles.get(id)? {
        Tile::Pane(pane) => Place::Pane(*pane),
        Tile::Container(Container::Tabs(tabs)) => {
            let front = tabs.children.iter().position(|&child| Some(child) == tabs.active).unwrap_or(0);
            Place::Tabs { front, children: places(&tabs.children)? }
        }
        Tile::Container(Container::Linear(linear)) => {
            let share = |child| linear.shares[child].clamp(*SHARES.start(), *SHARES.end());
            let shares = linear.children.iter().map(|&child| share(child)).collect();
            let children = places(&linear.children)?;
            match linear.dir {
                LinearDir::Horizontal => Place::Row { shares, children },
                LinearDir::Vertical => Place::Column { shares, children },
            }
        }
        Tile::Container(Container::Grid(grid)) => {
            let children: Vec<TileId> = grid.children().copied().collect();
            Place::Row { shares: vec![1.0; children.len()], children: places(&children)? }
        }
    })
}

impl Place {
    /// Whether it can be shown; `panes` gets those that are in it.
    fn is_sound(&self, panes: &mut Vec<Pane>) -> bool {
        let children = match self {
            Self::Pane(pane) => {
                panes.push(*pane);
                return panes.len() <= Pane::ALL.len();
            }
            Self::Tabs { front, children } if *front < children.len() => children,
            Self::Row { shares, children } | Self::Column { shares, children }
                if shares.len() == children.len() && shares.iter().all(|share| SHARES.contains(share)) =>
            {
                children
            }
            _ => return false,
        };
        !children.is_empty() && children.iter().all(|child| child.is_sound(panes))
    }

    fn put(&self, tiles: &mut Tiles<Pane>) -> TileId {
        match self {
            Self::Pane(pane) => tiles.insert_pane(*pane),
            Self::Tabs { front, children } => {
                let children = put_all(children, tiles);
                let mut tabs = egui_tiles::Tabs::new(children.clone());
                tabs.active = children.get(*front).copied();
                tiles.insert_container(tabs)
            }
            Self::Row { shares, children } => put_line(LinearDir::Horizontal, shares, children, tiles),
            Self::Column { shares, children } => put_line(LinearDir::Vertical, shares, children, tiles),
        }
    }
}

fn put_all(places: &[Place], tiles: &mut Tiles<Pane>) -> Vec<TileId> {
    places.iter().map(|place| place.put(tiles)).collect()
}

fn put_line(dir: LinearDir, shares: &[f32], places: &[Place], tiles: &mut Tiles<Pane>) -> TileId {
    let children = put_all(places, tiles);
    let mut linear = Linear::new(dir, children.clone());
    children.into_iter().zip(shares).for_each(|(child, share)| linear.shares.set_share(child, *share));
    tiles.insert_container(linear)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewer::layout::{Layout, first_tiles};

    #[test]
    fn what_is_saved_is_what_comes_back() {
        let mut layout = Layout::default();
        layout.bring(Pane::Streaming);
        layout.bring(Pane::Measure);
        layout.toggle_panels();
        let arrangement = layout.arrangement().unwrap();
        let text = serde_json::to_string(&arrangement).unwrap();
        let read: Arrangement = serde_json::from_str(&text).unwrap();
        let back = Layout::restored(Some(&read));
        assert_eq!(back.arrangement(), Some(arrangement));
        assert_ne!(back.arrangement(), Layout::default().arrangement());
        assert!(!back.shows_panels && text.contains("\"streaming\"") && text.contains("3.6"), "{text}");
    }

    #[test]
    fn what_makes_no_sense_becomes_the_first_layout() {
        let sound = serde_json::to_string(&Arrangement::of(&first_tiles(), true).unwrap()).unwrap();
        for (what, with) in [
            ("\"version\":1", "\"version\":2"),
            ("\"streaming\"", "\"look\""),
            ("3.6", "0.0"),
            ("3.6", "1e30"),
            ("3.6,", ""),
            ("\"front\":0", "\"front\":3"),
            ("{\"pane\":\"streaming\"}", "{\"tabs\":{\"front\":0,\"children\":[]}}"),
            (",{\"pane\":\"streaming\"}", ""),
        ] {
            assert!(sound.contains(what), "{what} is not in {sound}");
            let read: Arrangement = serde_json::from_str(&sound.replacen(what, with, 1)).unwrap();
            assert!(read.tree().is_none(), "{with}");
            assert_eq!(Layout::restored(Some(&read)).arrangement(), Layout::default().arrangement());
        }
        let read: Arrangement = serde_json::from_str(&sound).unwrap();
        assert!(read.tree().is_some());
    }
}
