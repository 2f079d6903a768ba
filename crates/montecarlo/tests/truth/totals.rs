//! Total reflectance and transmittance against adding-doubling.

use crate::reference::{Row, adding_doubling};
use montecarlo::{TallySpec, Walk};
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;

/// Runs to the standard error `u`. `examples/adding_doubling.rs` goes on to 5e-5.
fn check(row: &Row, walk: Option<Walk>, u: f64) {
    let mut simulation = row.simulation(&TallySpec::default(), 20).unwrap();
    if let Some(walk) = walk {
        simulation = simulation.with_walk(walk);
    }
    let name = row.name;
    let tally = simulation.run(0..1 << 12, &AtomicBool::new(false), |tally| {
        if tally.u() > u {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    assert!(tally.u() <= u, "{name}: {}", tally.u());
    let [r, t] = [tally.reflectance(), tally.transmittance()];
    let total = tally.specular().value + r.value;
    let (dr, ur) = (total - row.reflectance[0], r.u.hypot(row.reflectance[1]));
    let (dt, ut) = (
        t.value - row.transmittance[0],
        t.u.hypot(row.transmittance[1]),
    );
    assert!(
        dr.abs() <= 3.5 * ur,
        "{name}: R = {total} ± {ur}, {} off",
        dr / ur
    );
    // Where nothing comes through, nothing may.
    assert!(
        dt.abs() <= 3.5 * ut,
        "{name}: T = {} ± {ut}, {} off",
        t.value,
        dt / ut
    );
}

#[test]
fn every_total_in_lanes() {
    let rows = adding_doubling();
    assert_eq!(rows.len(), 10);
    for row in rows {
        check(&row, None, 5e-4);
    }
}

#[test]
fn the_totals_of_quick_media_by_the_scalar_walk() {
    let slow = ["marble_g", "marble_g_g09", "layers3_same_n14"];
    for row in adding_doubling()
        .iter()
        .filter(|row| !slow.contains(&row.name))
    {
        check(row, Some(Walk::Scalar), 1e-3);
    }
}
