//! Outliers at random rows: they are found, and none are found where there are none.

use kinoise::measure::{SigmaRow, SigmaTable};
use kinoise::model::{PAPER_EQ1, compare_forms, sort_out};
use kinoise::rng::Stream;
use kinoise::{Form, Seed};
use rand::seq::index::sample;
use rand_distr::{Distribution, StandardNormal};

/// 30 rows of Eq. 1: six distances, five tilts, with relative errors of size `noise`; if `counted`,
/// n_effective states that size.
fn table(noise: f64, counted: bool, rng: &mut Stream) -> SigmaTable {
    let mut rows = Vec::new();
    for i in 0..6 {
        let z_m = 1.0 + 0.6 * f64::from(i);
        for tilt in [0.0f64, 20.0, 40.0, 60.0, 75.0] {
            let theta_rad = tilt.to_radians();
            let draw: f64 = StandardNormal.sample(rng);
            let truth = Form::Paper.spec().sigma(&PAPER_EQ1, z_m, theta_rad);
            rows.push(SigmaRow {
                z_m,
                theta_rad,
                sigma_m: truth * (noise * draw).exp(),
                n_effective: counted.then_some(0.5 / (noise * noise)),
                view: rows.len(),
            });
        }
    }
    SigmaTable { rows }
}

/// Multiplies `count` random rows by `size`; returns these rows.
fn spoil(table: &mut SigmaTable, size: f64, count: usize, rng: &mut Stream) -> Vec<SigmaRow> {
    let at = sample(rng, table.rows.len(), count).into_vec();
    at.iter().for_each(|&i| table.rows[i].sigma_m *= size);
    at.into_iter().map(|i| table.rows[i]).collect()
}

const TABLES: usize = 40;

/// 1 to 4 outliers among 30 rows with 5 % noise: a factor of 30 or 1000 or its inverse is found in at least
/// 99 of 100 tables, a factor of 3 in 95 of 100. A missed one is a row alone at the end of the range (4 m,
/// 75 degrees), which the six coefficients can follow.
#[test]
#[ignore = "slow: sixteen hundred tables"]
fn outliers_of_any_size_are_found() {
    let mut rng = Seed(31).stream("outliers");
    for counted in [true, false] {
        for (size, least) in
            [(3.0, 0.95), (30.0, 0.99), (1000.0, 0.99), (1.0 / 30.0, 0.99), (1e-3, 0.99)]
        {
            let (mut whole, mut more) = (0, 0);
            for trial in 0..4 * TABLES {
                let mut table = table(0.05, counted, &mut rng);
                let spoiled = spoil(&mut table, size, 1 + trial % 4, &mut rng);
                let left_out = sort_out(&table).left_out;
                let found = spoiled.iter().filter(|r| left_out.contains(r)).count();
                whole += usize::from(found == spoiled.len());
                more += left_out.len() - found;
            }
            let share = whole as f64 / (4 * TABLES) as f64;
            println!(
                "x{size:.3} counted {counted}: all found in {share:.3}, good rows lost {more}"
            );
            assert!(share >= least, "x{size} counted {counted}: {share}");
            // Four thousand good rows.
            assert!(more <= 12, "x{size} counted {counted}: {more} good rows left out");
        }
    }
}

/// A table that loses any of its 30 rows is a false alarm: below 2 % without n (0.4 % measured over 4,000;
/// at that rate nine or more of 400 occur once in ten thousand), never with n.
#[test]
fn clean_tables_lose_no_row() {
    let mut rng = Seed(32).stream("clean");
    for counted in [true, false] {
        let mut alarms = 0;
        for trial in 0..400 {
            let noise = [0.02, 0.05, 0.1, 0.2][trial % 4];
            alarms += usize::from(!sort_out(&table(noise, counted, &mut rng)).left_out.is_empty());
        }
        println!("counted {counted}: {alarms} of 400 clean tables lose a row");
        assert!(alarms <= if counted { 0 } else { 8 }, "counted {counted}: {alarms}");
    }
}

/// A whole view of something else: its eight cells are forty times too large.
#[test]
fn a_view_of_something_else_is_left_out_whole() {
    let mut rng = Seed(33).stream("view");
    let mut table = SigmaTable::default();
    for view in 0..10 {
        for cell in 0..8 {
            let (z_m, theta_rad) = (1.0 + 0.3 * view as f64 + 0.02 * f64::from(cell), 0.3);
            let draw: f64 = StandardNormal.sample(&mut rng);
            let truth = Form::Paper.spec().sigma(&PAPER_EQ1, z_m, theta_rad);
            let sigma_m = truth * (0.05 * draw).exp() * if view == 4 { 40.0 } else { 1.0 };
            table.rows.push(SigmaRow { z_m, theta_rad, sigma_m, n_effective: Some(200.0), view });
        }
    }
    let sorted = sort_out(&table);
    assert_eq!(sorted.left_out.len(), 8, "{:?}", sorted.remark);
    assert!(sorted.left_out.iter().all(|r| r.view == 4));
}

/// Fits of any form, and the comparison of the forms, use the good rows only.
#[test]
fn outliers_pull_no_form_and_no_comparison() {
    let mut rng = Seed(34).stream("pull");
    let mut all = table(0.03, true, &mut rng);
    let spoiled = spoil(&mut all, 1000.0, 3, &mut rng);
    let good =
        SigmaTable { rows: all.rows.iter().filter(|r| !spoiled.contains(r)).copied().collect() };
    let sorted = sort_out(&all);
    assert_eq!((sorted.left_out.len(), &sorted.kept), (3, &good));
    for form in Form::ALL {
        let (with, without) = (sorted.fit(form).unwrap(), sort_out(&good).fit(form).unwrap());
        assert_eq!(with.values(), without.values(), "{form}");
        assert!(with.remarks[0].starts_with("3 of 30 sigmas"), "{form}: {:?}", with.remarks);
    }
    let scores = compare_forms(&sorted.kept);
    assert_eq!(scores, compare_forms(&good));
    assert_eq!(scores[0].form, Form::Paper, "{scores:?}");
}

/// Two populations are no outliers: nothing is left out, and the fit is reported as poor.
#[test]
fn a_third_of_the_rows_is_no_outlier() {
    let mut rng = Seed(35).stream("third");
    let mut table = table(0.03, true, &mut rng);
    table.rows.retain(|r| r.theta_rad < 1.2);
    for i in (0..table.rows.len()).step_by(3) {
        table.rows[i].sigma_m *= 20.0;
    }
    let sorted = sort_out(&table);
    assert!(sorted.left_out.is_empty());
    let fitted = sorted.fit(Form::Paper).unwrap();
    let words = fitted.remarks.join("\n");
    assert!(fitted.quality.is_poor() && words.contains("the fit is poor"), "{words}");
}
