//! Flights in, the page out: one text that loads nothing from anywhere.
//!
//! From top to bottom: the headline of one flight in tiles and pictures; all flights side by side, where there are
//! several; the paper's tables; every flight by itself; the machine.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::chart::style_rules;
use super::pictures::{Picture, pictures};
use super::plots::{Figure, digits, share};
use super::read::Flown;
use super::tables::{FRAME_COLUMNS, Row, STREAMING_COLUMNS};
use super::{ReportError, bands, paper, plots, tables, versus};
use crate::stats::report::{Flight, human};

/// Nothing may be loaded; what is written in the page itself may be shown.
const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'";

/// The page of some flights.
///
/// # Errors
/// [`ReportError`]: there is no flight, a picture cannot be read, a plot cannot be drawn.
pub fn page(flights: &[Flown], title: Option<&str>) -> Result<String, ReportError> {
    let chief = chief(flights).ok_or(ReportError::NoFlights)?;
    let title = title.map_or_else(|| default_title(chief), str::to_owned);
    let body = html! {
        (header(flights, chief, &title))
        (tiles(chief))
        (picture_strip(chief)?)
        @if flights.len() > 1 { (side_by_side(flights)?) }
        (papers_tables(flights))
        @for (number, flight) in flights.iter().enumerate() {
            (one_flight(flight, number, flights.len(), std::ptr::eq(flight, chief))?)
        }
        (machines(flights))
        (footer())
    };
    Ok(document(&title, &body).into_string())
}

/// The flight of the headline: the first coherent one.
fn chief(flights: &[Flown]) -> Option<&Flown> {
    flights.iter().find(|flight| flight.summary.flight.strategy == "coherent").or(flights.first())
}

fn default_title(flight: &Flown) -> String {
    match flight.summary.flight.model.as_str() {
        "" => format!("Flight {}", flight.group),
        model => format!("A flight over {model}"),
    }
}

fn document(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(style_rules())) (PreEscaped(include_str!("style.css"))) }
            }
            body { main { (body) } }
        }
    }
}

fn header(flights: &[Flown], chief: &Flown, title: &str) -> Markup {
    let flight = &chief.summary.flight;
    html! {
        header {
            h1 { (title) }
            p.lead { (code(&what_was_flown(chief))) }
            @if !flight.model.is_empty() {
                p.lead {
                    (flight.model) ": " (human::count(flight.model_triangles)) " triangles in "
                    (human::count(flight.parts)) " parts, placed " (human::count(flight.instances)) " times; "
                    (human::bytes(flight.file_bytes)) " on disk."
                }
            }
            @if flights.iter().any(|flight| is_software(&flight.summary.flight)) {
                p.banner {
                    strong { "Software graphics. " }
                    "No graphics card drew this: the processor did. Timings are for ratios within this run only; counts and "
                    "bytes are what they would be on any card."
                }
            }
        }
    }
}

fn what_was_flown(flown: &Flown) -> String {
    let flight = &flown.summary.flight;
    format!(
        "{} frames along `{}` at {} × {} pixels, with {} vertices to spend on each.",
        human::count(flown.summary.frames),
        flight.path,
        flight.width,
        flight.height,
        human::count(flight.budget_vertices)
    )
}

/// Whether the processor drew: timings then say little.
fn is_software(flight: &Flight) -> bool {
    flight.adapter.ends_with(", Cpu)") || flight.adapter.starts_with("CPU reference")
}

/// Text in which back quotes make code.
fn code(text: &str) -> Markup {
    html! {
        @for (number, piece) in text.split('`').enumerate() {
            @if number % 2 == 1 { code { (piece) } } @else { (piece) }
        }
    }
}

fn tile(number: &str, unit: &str, words: &str) -> Markup {
    html! {
        div.tile {
            div.number { (number) @if !unit.is_empty() { " " span.unit { (unit) } } }
            div.words { (code(words)) }
        }
    }
}

fn tiles(flown: &Flown) -> Markup {
    let summary = &flown.summary;
    let (sent, sent_unit) = split(&human::bytes(summary.bytes_sent_total));
    let whole = human::bytes(summary.bytes_whole_total);
    let saving = summary.transfer_saving.map_or("–".to_owned(), digits);
    let of = match summary.flight.model_triangles {
        0 => String::new(),
        all => format!(", of {} in the model", human::count(all)),
    };
    let ms = human::milliseconds;
    let slowest =
        if summary.frames < 1000 { "the slowest frame (p99.9)" } else { "one in 1,000 is slower (p99.9)" };
    html! {
        div.tiles {
            div.tile.chief {
                div.number { (saving) span.unit { " ×" } }
                div.words { (code("transfer saving: what `whole` would send over what was sent")) }
            }
            (tile(&sent, &sent_unit, &format!("sent in all, where `whole` sends {whole}")))
            @if let Some(steady) = summary.steady_share {
                (tile(share(steady, 1.0).trim_end_matches(" %"), "%", "of what `whole` sends, after the first frame"))
            }
            (tile(&human::rounded(summary.active_triangles_mean), "", &format!("triangles drawn in a mean frame{of}")))
            (tile(&human::count(summary.frames), "", &format!("frames along `{}`", summary.flight.path)))
            (tile(&ms(summary.frame_ms_p50), "ms", "the median frame (p50)"))
            (tile(&ms(summary.frame_ms_p99), "ms", "one frame in 100 is slower (p99)"))
            (tile(&ms(p999(flown)), "ms", slowest))
        }
    }
}

/// Older summaries do not have it.
fn p999(flown: &Flown) -> f64 {
    let ms: Vec<f64> = plots::values(flown, |record| record.frame_ms).collect();
    crate::stats::report::percentile(&ms, 99.9)
}

fn split(text: &str) -> (String, String) {
    let (number, unit) = text.split_once(' ').unwrap_or((text, ""));
    (number.to_owned(), unit.to_owned())
}

fn picture_strip(flown: &Flown) -> Result<Markup, ReportError> {
    let pictures: Vec<Picture> = pictures(&flown.pictures)?;
    Ok(html! {
        @if !pictures.is_empty() {
            div.pictures {
                @for picture in &pictures {
                    figure {
                        img src=(picture.source) alt=(picture.name) width=(picture.size.0) height=(picture.size.1);
                        figcaption { (picture.name) }
                    }
                }
            }
        }
    })
}

fn figures(figures: &[Figure]) -> Markup {
    html! {
        div.figures {
            @for figure in figures {
                figure.card {
                    h3 { (figure.title) }
                    @if !figure.key.is_empty() {
                        ul.key {
                            @for (colour, name) in &figure.key {
                                li { i style=(format!("background:{}", colour.variable())) {} (code(name)) }
                            }
                        }
                    }
                    (PreEscaped(&figure.svg))
                    figcaption { (code(&figure.caption)) }
                }
            }
        }
    }
}

fn side_by_side(flights: &[Flown]) -> Result<Markup, ReportError> {
    Ok(html! {
        section {
            h2 { "Side by side" }
            (overview(flights))
            (figures(&versus::of_flights(flights)?))
        }
    })
}

const OVERVIEW: [(&str, &str); 9] = [
    ("Frames", ""),
    ("Triangles", "drawn a frame"),
    ("Sent", "in all"),
    ("whole", "would send"),
    ("Saving", "of transfer"),
    ("Steady", "after the first frame"),
    ("p50", "ms a frame"),
    ("p99", "ms a frame"),
    ("p99.9", "ms a frame"),
];

fn overview(flights: &[Flown]) -> Markup {
    let cells = |flown: &Flown| {
        let summary = &flown.summary;
        let ms = human::milliseconds;
        [
            human::count(summary.frames),
            human::rounded(summary.active_triangles_mean),
            human::bytes(summary.bytes_sent_total),
            human::bytes(summary.bytes_whole_total),
            summary.transfer_saving.map_or("–".to_owned(), |saving| format!("{} ×", digits(saving))),
            summary.steady_share.map_or("–".to_owned(), |steady| share(steady, 1.0)),
            ms(summary.frame_ms_p50),
            ms(summary.frame_ms_p99),
            ms(p999(flown)),
        ]
    };
    html! {
        div.table {
            table {
                thead { tr { th.left { "Flight" } (headings(&OVERVIEW)) } }
                tbody {
                    @for (number, flown) in flights.iter().enumerate() {
                        tr {
                            th { i.dot style=(format!("background:{}", versus::colour(number).variable())) {} (flown.name) }
                            @for cell in cells(flown) { td { (cell) } }
                        }
                    }
                }
            }
        }
    }
}

fn headings(columns: &[(&str, &str)]) -> Markup {
    html! {
        @for (name, unit) in columns { th { (name) @if !unit.is_empty() { br; small { (unit) } } } }
    }
}

fn table(columns: &[(&str, &str)], heads: [&str; 2], rows: &[Row]) -> Markup {
    html! {
        div.table {
            table {
                thead { tr { @for head in heads { th.left { (head) } } (headings(columns)) } }
                tbody {
                    @for (number, row) in rows.iter().enumerate() {
                        @let begins = number == 0 || rows[number - 1].head != row.head;
                        tr.ours[row.is_ours] .begins[begins] {
                            th { @if begins { (row.head) } }
                            th { (row.run) }
                            @for cell in &row.cells { td { (cell) } }
                        }
                    }
                }
            }
        }
    }
}

fn papers_tables(flights: &[Flown]) -> Markup {
    html! {
        section {
            h2 { "Beside the paper" }
            p {
                "Peng & Cao, " cite { "A GPU-based Approach for Massive Model Rendering with Frame-to-Frame Coherence" }
                " (2012), measured a Boeing 777 of 332 million triangles and a power plant of 12 million on an "
                (paper::MACHINE) ". Their numbers are for chosen cameras (a) to (d); ours, on shaded rows, are means "
                "over all frames of a flight. What can be compared across machines and models is the streamed share and "
                "what a strategy costs over SC in the same run, not milliseconds."
            }
            h3 { "Table 1: three ways of sending" }
            (table(&STREAMING_COLUMNS, ["Strategy", "Run"], &tables::streaming(flights)))
            p.note {
                b { "SC" } " sends what the GPU lacks (" code { "coherent" } "), " b { "SnC" } " sends all in one block ("
                code { "whole" } "), " b { "NS" } " sends all part by part (" code { "per-part" } "). Collection is our "
                "delta and gather, transfer our upload. Streaming is the sum of the three columns before it. Our SnC and "
                "NS pass through the same defragmentation as SC; the paper's do not."
            }
            h3 { "Table 2: a whole frame" }
            (table(&FRAME_COLUMNS, ["Strategy", "Run"], &tables::frames(flights)))
            p.note {
                "Shares are of the sum of the four stages. Selection is our select and residency; streaming is delta, "
                "gather, upload and defragment. The power plant fits in GPU memory and was not streamed. Two numbers of "
                "Boeing 777 (b) look misprinted in the paper: Table 1 has 17,373,329 triangles, and its share of rendering, "
                "22.62 %, would be 41.3 ms."
            }
        }
    }
}

fn one_flight(flown: &Flown, number: usize, flights: usize, is_chief: bool) -> Result<Markup, ReportError> {
    let alone = flights == 1;
    let frames = flown.records.len();
    Ok(html! {
        section {
            h2 {
                @if !alone { i.dot style=(format!("background:{}", versus::colour(number).variable())) {} }
                @if alone { "The flight, frame by frame" } @else { (flown.name) }
            }
            @if !alone { p { (code(&what_was_flown(flown))) } }
            @if !flown.summary.flight.command.is_empty() { pre { (flown.summary.flight.command) } }
            @if !is_chief { (tiles(flown)) (picture_strip(flown)?) }
            @if bands::frames_per_band(frames) > 1 {
                p.note {
                    "This flight has more frames than a plot has room for: plots over frames show "
                    (human::count(frames.div_ceil(bands::frames_per_band(frames)) as u64)) " bands of "
                    (human::count(bands::frames_per_band(frames) as u64)) " frames, each by its mean, its least and its greatest "
                    "value. Tables, tiles and percentiles are of all frames."
                }
            }
            (figures(&plots::of_flight(flown)?))
        }
    })
}

/// What a flight ran on: names and values.
type MachineLines = Vec<(&'static str, String)>;

fn machine_lines(flight: &Flight) -> MachineLines {
    let timed = match (flight.gpu_timestamps, is_software(flight)) {
        (true, _) => "by timestamps on the GPU",
        (false, true) => "by the CPU around a wait, as a software adapter's timestamps mean nothing",
        (false, false) => "by the CPU around a wait, as the adapter has no timestamps",
    };
    let unknown = || "not known".to_owned();
    vec![
        ("Adapter", flight.adapter.clone()),
        ("Processor", flight.cpu.clone().unwrap_or_else(unknown)),
        ("Threads", flight.cores.map_or_else(unknown, human::count)),
        ("Memory", flight.memory_bytes.map_or_else(unknown, human::bytes)),
        ("GPU stages timed", timed.to_owned()),
        ("Selection on", flight.select.to_uppercase()),
        (
            "Version",
            if flight.version.is_empty() { unknown() } else { format!("collapsar {}", flight.version) },
        ),
    ]
}

fn machines(flights: &[Flown]) -> Markup {
    let mut found: Vec<(MachineLines, Vec<&str>)> = Vec::new();
    for flown in flights {
        let lines = machine_lines(&flown.summary.flight);
        match found.iter_mut().find(|(other, _)| *other == lines) {
            Some((_, names)) => names.push(&flown.name),
            None => found.push((lines, vec![&flown.name])),
        }
    }
    html! {
        section {
            h2 { "Measured on" }
            div.figures {
                @for (lines, names) in &found {
                    div.card {
                        @if found.len() > 1 { h3 { (names.join(", ")) } }
                        dl { @for (name, value) in lines { dt { (name) } dd { (value) } } }
                    }
                }
            }
        }
    }
}

fn footer() -> Markup {
    html! {
        footer {
            p {
                "Made by " code { "collapsar report" } " " (env!("CARGO_PKG_VERSION")) " from the files that "
                code { "collapsar fly --out" } " wrote. Active is what is drawn, streamed what was sent for it; "
                code { "ecol" } " are collapse targets, tables are budgets, draw arguments and the camera."
            }
        }
    }
}
