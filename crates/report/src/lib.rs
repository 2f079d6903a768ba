//! Shows a measurement to a person: figures, tables and one page that holds them all.
//!
//! Everything is text made in memory, for the caller to write. What comes out depends on what goes
//! in and on nothing else: no clock, no host, no path. Figures are plain SVG; the page is one HTML
//! file that needs no network. Its one script enlarges figures; everything is there without it.
//!
//! | module | holds |
//! |---|---|
//! | `number` | [`uncertain`]: a value and its uncertainty, rounded as they should be |
//! | `table` | [`text_table`]: aligned columns for a terminal |
//! | `channel` | [`ChannelReport`]: what is shown of one channel, and what follows from its fit |
//! | `axis` | scales and ticks |
//! | `markup` | text from outside made safe; symbols raised and lowered |
//! | `chart` | [`chart_svg`]: lines in panels |
//! | `figure` | [`figure_svg`]: profile, fit and residuals |
//! | `preview` | [`preview_text`]: profile and fit on a terminal |
//! | `picture` | [`picture_svg`]: the merged picture in false colours |
//! | `page` | [`Report`] and [`report_html`] |
//! | `batch` | [`batch_html`]: many measurements, and what became of each |
//! | `validation` | [`validation_html`]: a scene under several methods |

mod axis;
mod batch;
mod channel;
mod chart;
mod figure;
mod markup;
mod number;
mod page;
mod picture;
mod preview;
mod table;
mod validation;

pub use batch::{BatchChannel, BatchPage, BatchRow, batch_html};
pub use channel::{ChannelReport, CurvePoint, ModelReport};
pub use chart::{Chart, Line, Panel, Scale, Stroke, chart_svg};
pub use figure::figure_svg;
pub use number::{at_least, at_most, significant, uncertain};
pub use page::{ExposureRow, Input, Report, Swatch, report_html};
pub use picture::{Outline, Picture, SHADES, palette, picture_svg, shade};
pub use preview::preview_text;
pub use table::text_table;
pub use validation::{ValidationPage, ValidationRow, validation_html};
