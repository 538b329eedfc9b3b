//! What the user wants to know about one instance: its state as it is drawn, out of the renderer's.

use crate::frame::Renderer;
use crate::frame::colour_by::OLD_FRAMES;
use crate::scene::Scene;

/// An instance as it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reading {
    /// Its number in the scene.
    pub instance: u32,
    /// The tier of which its triangles are; `None` while nothing of it is drawn.
    pub tier: Option<u32>,
    /// Tiers that its part has.
    pub tier_count: u32,
    /// Vertices that are drawn, that it was wished to have, and that there are.
    pub vertices: [u32; 3],
    /// Triangles that are drawn, and that there are.
    pub triangles: [u32; 2],
    /// Vertices of its part that are in memory.
    pub arrived: u32,
}

/// Keeps for each instance how long ago what is drawn of it changed, while anybody asks.
#[derive(Debug, Default)]
pub struct Watch {
    vertices: Vec<u32>,
    ages: Vec<u32>,
}

impl Watch {
    /// Looks at a frame that was drawn; forgets everything if nobody asks for ages.
    pub fn after(&mut self, renderer: &Renderer, wants_ages: bool) {
        if !wants_ages {
            *self = Self::default();
            return;
        }
        let states = renderer.states();
        if self.vertices.len() != states.len() {
            self.vertices = states.iter().map(|state| state.vertices).collect();
            self.ages = vec![OLD_FRAMES; states.len()];
        }
        for ((old, age), state) in self.vertices.iter_mut().zip(&mut self.ages).zip(states) {
            *age = if *old == state.vertices { (*age + 1).min(OLD_FRAMES) } else { 0 };
            *old = state.vertices;
        }
    }

    /// Frames since each instance changed, at most [`OLD_FRAMES`]; empty if nobody has asked.
    pub fn ages(&self) -> &[u32] {
        &self.ages
    }

    /// Whether any colour would still change.
    pub fn is_aging(&self) -> bool {
        self.ages.iter().any(|&age| age < OLD_FRAMES)
    }

    /// An instance as it is drawn.
    pub fn reading(&self, scene: &Scene, renderer: &Renderer, instance: u32) -> Reading {
        let row = &scene.instances()[instance as usize];
        let part = &scene.parts()[row.part as usize];
        let state = renderer.states()[instance as usize];
        Reading {
            instance,
            tier: (!state.is_empty()).then_some(state.tier),
            tier_count: part.tier_count,
            vertices: [state.vertices, renderer.wishes()[instance as usize], part.vertices],
            triangles: [state.triangles, part.triangles],
            arrived: renderer.resident(row.part).vertices_arrived(),
        }
    }
}
