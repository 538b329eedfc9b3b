//! The window: the system's events in, the app's layouts shown, what it asks for done.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::application::ApplicationHandler;
use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::{Fullscreen, Window, WindowId};

use super::app::{App, Ask};
use super::pace::Pace;
use super::painter::Wake;
use super::screen::{Layout, Screen};
use super::settings::{Store, WindowShape};
use crate::gpu::GpuError;

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    /// There is no display.
    #[error(
        "no window can be opened: {0}; is there a display (DISPLAY or WAYLAND_DISPLAY)? Without one, use `collapsar shot` or `fly`"
    )]
    NoDisplay(String),
    /// The graphics card.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// How to show a window.
#[derive(Debug, Clone, Default)]
pub struct WindowOptions {
    /// What to open in it.
    pub file: Option<PathBuf>,
    /// Its size in pixels; the system's choice without.
    pub size: Option<(u32, u32)>,
    /// Loses its surface, its device or memory once in so many layouts, to show that it goes on.
    pub mishaps: Mishaps,
}

/// What is to go wrong, and how often: once in so many layouts; 0 for never.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Mishaps {
    /// The surface is lost.
    pub surface: u32,
    /// The device is lost.
    pub device: u32,
}

/// What a window has to tell once it is closed.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct WindowSummary {
    /// How long turns of the loop took.
    pub pace: Pace,
    /// Surfaces that were made anew.
    pub surfaces_lost: u64,
    /// Devices that were made anew.
    pub devices_lost: u64,
}

/// News from another thread.
#[derive(Debug, Clone, Copy)]
struct News;

/// Shows a window until it is closed.
///
/// # Errors
/// There is no display, or no graphics card that can show anything on it.
pub fn run(options: WindowOptions) -> Result<WindowSummary, WindowError> {
    let no_display = |error: winit::error::EventLoopError| WindowError::NoDisplay(in_words(&error));
    let event_loop = EventLoop::<News>::with_user_event().build().map_err(no_display)?;
    let proxy = event_loop.create_proxy();
    let wake = proxy.clone();
    let wake: Wake = Arc::new(move || {
        // The loop may have ended, and then nobody wants to know.
        let _ = wake.send_event(News);
    });
    let app = App::new(Store::of_user(), wake);
    let mut shell = Shell {
        app,
        options,
        proxy,
        context: egui::Context::default(),
        shown: None,
        title: "collapsar".to_owned(),
        save_as: None,
        next: None,
        summary: WindowSummary::default(),
        layouts: 0,
        failed: None,
    };
    event_loop.run_app(&mut shell).map_err(no_display)?;
    shell.app.close();
    match shell.failed {
        Some(error) => Err(error),
        None => Ok(shell.summary),
    }
}

/// What an error says, without the place in the source of the library that it comes from.
fn in_words(error: &dyn std::fmt::Display) -> String {
    let text = error.to_string();
    let after_place = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    after_place.map_or(text.clone(), |(_, words)| words.trim_end_matches('.').to_owned())
}

/// A window that is there.
struct Shown {
    window: Arc<Window>,
    screen: Screen,
    input: egui_winit::State,
}

struct Shell {
    app: App,
    options: WindowOptions,
    proxy: EventLoopProxy<News>,
    context: egui::Context,
    shown: Option<Shown>,
    /// What the window is called.
    title: String,
    save_as: Option<PathBuf>,
    /// When the interface wants to be laid out again.
    next: Option<Instant>,
    summary: WindowSummary,
    layouts: u32,
    failed: Option<WindowError>,
}

impl ApplicationHandler<News> for Shell {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.shown.is_some() {
            return;
        }
        match self.open_window(event_loop) {
            Ok(shown) => {
                self.app.set_gpu(Arc::clone(shown.screen.gpu()));
                self.shown = Some(shown);
                if let Some(file) = self.options.file.take() {
                    self.app.open(&file);
                }
            }
            Err(error) => self.end(event_loop, Some(error)),
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, _: News) {
        self.request_redraw();
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shown) = &mut self.shown else { return };
        match &event {
            WindowEvent::RedrawRequested => return self.redraw(event_loop),
            WindowEvent::Resized(size) => shown.screen.resize(*size),
            WindowEvent::CloseRequested => return self.end(event_loop, None),
            _ => {}
        }
        if shown.input.on_window_event(&shown.window, &event).repaint {
            shown.window.request_redraw();
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        match self.next {
            Some(next) if next <= Instant::now() => {
                self.next = None;
                self.request_redraw();
                event_loop.set_control_flow(ControlFlow::Wait);
            }
            Some(next) => event_loop.set_control_flow(ControlFlow::WaitUntil(next)),
            None => event_loop.set_control_flow(ControlFlow::Wait),
        }
    }
}

impl Shell {
    fn open_window(&self, event_loop: &ActiveEventLoop) -> Result<Shown, WindowError> {
        let mut attributes = Window::default_attributes().with_title(&self.title);
        let shape = self.app.settings.window.unwrap_or_default();
        attributes = match self.options.size {
            Some((width, height)) => attributes.with_inner_size(PhysicalSize::new(width, height)),
            None => attributes
                .with_inner_size(LogicalSize::new(shape.width, shape.height))
                .with_maximized(shape.is_maximised),
        };
        let window =
            event_loop.create_window(attributes).map_err(|error| WindowError::NoDisplay(in_words(&error)))?;
        let window = Arc::new(window);
        let screen = Screen::new(event_loop.owned_display_handle(), Arc::clone(&window))?;
        self.wake_with_context();
        Ok(Shown { input: self.input_of(&window, &screen), window, screen })
    }

    /// Other threads that ask the interface for another layout wake the loop.
    fn wake_with_context(&self) {
        let proxy = self.proxy.clone();
        self.context.set_request_repaint_callback(move |info| {
            if info.delay.is_zero() {
                // The loop may have ended, and then nobody wants to know.
                let _ = proxy.send_event(News);
            }
        });
    }

    fn input_of(&self, window: &Window, screen: &Screen) -> egui_winit::State {
        egui_winit::State::new(
            self.context.clone(),
            egui::ViewportId::ROOT,
            window,
            Some(window.scale_factor() as f32),
            window.theme(),
            Some(screen.gpu().limits.max_texture_dimension_2d as usize),
        )
    }

    fn request_redraw(&self) {
        if let Some(shown) = &self.shown {
            shown.window.request_redraw();
        }
    }

    fn end(&mut self, event_loop: &ActiveEventLoop, failed: Option<WindowError>) {
        self.failed = self.failed.take().or(failed);
        self.remember_window();
        if let Some(shown) = self.shown.take() {
            self.summary.surfaces_lost += shown.screen.surfaces_lost;
        }
        self.app.document = None;
        event_loop.exit();
    }

    /// Keeps the window's size for the next time, unless it was asked for by the command or fills the screen for now.
    fn remember_window(&mut self) {
        let Some(Shown { window, .. }) = &self.shown else { return };
        if self.options.size.is_some() || window.fullscreen().is_some() {
            return;
        }
        let size: LogicalSize<f32> = window.inner_size().to_logical(window.scale_factor());
        let before: WindowShape = self.app.settings.window.unwrap_or_default();
        self.app.settings.window = Some(before.after([size.width, size.height], window.is_maximized()));
    }

    /// One turn: news, layout, picture.
    fn redraw(&mut self, event_loop: &ActiveEventLoop) {
        let started = Instant::now();
        self.cause_mishaps();
        self.app.poll();
        let layout = self.lay_out();
        let laid_out = started.elapsed();
        let result = self.present(layout);
        self.summary.pace.add(laid_out, started.elapsed());
        match result {
            Ok(()) => self.do_what_is_asked(event_loop),
            Err(GpuError::Lost(_) | GpuError::OutOfMemory) => self.renew_device(event_loop),
            Err(error) => self.end(event_loop, Some(error.into())),
        }
    }

    fn lay_out(&mut self) -> Option<Layout> {
        let shown = self.shown.as_mut()?;
        let texture = match self.app.picture() {
            Some(target) => Some(shown.screen.texture_of(target)),
            None => {
                shown.screen.forget_picture();
                None
            }
        };
        let input = shown.input.take_egui_input(&shown.window);
        let app = &mut self.app;
        let mut output = self.context.run_ui(input, |ui| app.show(ui, texture));
        shown.input.handle_platform_output(&shown.window, std::mem::take(&mut output.platform_output));
        let title = self.app.title();
        if self.title != title {
            shown.window.set_title(&title);
            self.title = title;
        }
        self.next = self.when(&output);
        let shapes = std::mem::take(&mut output.shapes);
        Some(Layout {
            triangles: self.context.tessellate(shapes, output.pixels_per_point),
            textures: std::mem::take(&mut output.textures_delta),
            pixels_per_point: output.pixels_per_point,
        })
    }

    /// When the interface wants to be laid out again.
    fn when(&self, output: &egui::FullOutput) -> Option<Instant> {
        let delay = output.viewport_output.get(&egui::ViewportId::ROOT)?.repaint_delay;
        (delay < Duration::from_secs(3600)).then(|| Instant::now() + delay)
    }

    fn present(&mut self, layout: Option<Layout>) -> Result<(), GpuError> {
        let (Some(shown), Some(layout)) = (&mut self.shown, layout) else { return Ok(()) };
        let save_as = self.save_as.take();
        let size = shown.window.inner_size();
        if size.width == 0 || size.height == 0 {
            // Minimised: what egui changed in its textures is still taken.
            return shown.screen.take_textures(layout);
        }
        if let Some(saved) = shown.screen.show(layout, save_as.as_deref())? {
            self.app.say_saved(saved.map(|()| save_as.unwrap_or_default()));
        }
        Ok(())
    }

    fn do_what_is_asked(&mut self, event_loop: &ActiveEventLoop) {
        for ask in self.app.asks() {
            match ask {
                Ask::Quit => self.end(event_loop, None),
                Ask::ToggleFullscreen => self.toggle_fullscreen(),
                Ask::SaveWindow(path) => {
                    self.save_as = Some(path);
                    self.request_redraw();
                }
                Ask::NewDevice => self.renew_device(event_loop),
            }
        }
    }

    fn toggle_fullscreen(&self) {
        let Some(shown) = &self.shown else { return };
        let is_full = shown.window.fullscreen().is_some();
        shown.window.set_fullscreen((!is_full).then_some(Fullscreen::Borderless(None)));
    }

    /// Makes another device for the same window; the app keeps its camera and all else.
    fn renew_device(&mut self, event_loop: &ActiveEventLoop) {
        self.summary.devices_lost += 1;
        let Some(Shown { window, screen, .. }) = self.shown.take() else { return };
        self.summary.surfaces_lost += screen.surfaces_lost;
        if let Some(document) = &mut self.app.document {
            document.stop();
        }
        // The old device, its surface and all textures go before the new ones come.
        drop(screen);
        match Screen::new(event_loop.owned_display_handle(), Arc::clone(&window)) {
            Ok(screen) => {
                self.context = fresh_context(&self.context);
                self.wake_with_context();
                self.app.set_gpu(Arc::clone(screen.gpu()));
                window.request_redraw();
                self.shown = Some(Shown { input: self.input_of(&window, &screen), window, screen });
            }
            Err(error) => self.end(event_loop, Some(error.into())),
        }
    }

    fn cause_mishaps(&mut self) {
        self.layouts += 1;
        let Mishaps { surface, device } = self.options.mishaps;
        let is_due = |every: u32| every > 0 && self.layouts.is_multiple_of(every);
        let Some(shown) = &mut self.shown else { return };
        if is_due(surface)
            && let Err(error) = shown.screen.renew_surface()
        {
            tracing::warn!(%error, "the surface could not be made anew");
        }
        if is_due(device) {
            shown.screen.gpu().lose("on request");
        }
    }
}

/// A context with the memory of another and none of its textures, which were on a device that is gone.
fn fresh_context(old: &egui::Context) -> egui::Context {
    let context = egui::Context::default();
    let memory = old.memory(Clone::clone);
    context.memory_mut(|new| *new = memory);
    context
}
