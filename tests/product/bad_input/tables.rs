//! Tables of measurements.

use super::*;

#[test]
fn a_good_table() {
    Bench::empty().fit(GOOD_TABLE).tells(&["note: "]);
}

#[test]
fn tables_with_a_bad_cell() {
    for (row, says) in [
        ("1e300,0,0.01", "z_m = 1e300"),
        ("1500,0,0.01", "z_m = 1500 is farther than any"),
        ("-1e300,0,0.003", "z_m = -1e300 must be positive"),
        ("2,0,1e300", "sigma_m = 1e300 is no depth noise"),
        ("nan,0,0.01", "z_m"),
        ("inf,0,0.01", "z_m"),
        ("-2,0,0.01", "z_m"),
        ("0,0,0.01", "z_m"),
        ("2,45,0.01", "degrees"),
        ("2,-0.1,0.01", "theta_rad"),
        ("2,0,-0.01", "sigma_m"),
        ("2,0,0", "sigma_m"),
        ("2,0,NaN", "sigma_m"),
        ("2,0,", "sigma_m"),
        ("2,0,six", "sigma_m"),
        ("2,0", "2 cells, the header has 3"),
        ("2;0;0.01", "line 6"),
    ] {
        let run = Bench::empty().fit(&format!("{GOOD_TABLE}{row}\n"));
        run.fails(&["table.csv", "line 6", says]);
    }
}

#[test]
fn tables_that_are_no_tables() {
    for (table, says) in [
        ("", "z_m"),
        ("1,0,0.0019\n1.5,0,0.0035\n", "z_m"),
        ("z_m,sigma_m\n1,0.002\n", "theta_rad"),
        ("z,theta,sigma\n1,0,0.002\n", "z_m"),
        ("z_m,theta_rad,sigma_m\n", "too few"),
        ("z_m,theta_rad,sigma_m,n\n1,0,0.002,5\n1,0,0.002,\n", "missing in others"),
        ("z_m,theta_rad,sigma_m\n1,0,0.0019\n2,0,0.006\n", "too few"),
        ("z_m,theta_rad,sigma_m\n2,0,0.006\n2,0,0.006\n2,0,0.006\n2,0.5,0.006\n", "distance"),
        ("{\"format\": \"kinoise-model/1\"}", "z_m"),
    ] {
        Bench::empty().fit(table).fails(&["table.csv", says]);
    }
    let bench = Bench::empty();
    let gone = bench.folder.path().join("gone.csv");
    bench.run("fit", &gone, &[]).fails(&["gone.csv"]);
    let binary = bench.folder.path().join("binary.csv");
    fs::write(&binary, [0xff, 0xfe, 0x00, 0x80, b'\n', 0xff]).expect("written");
    bench.run("fit", &binary, &[]).fails(&["binary.csv"]);
    bench.run("fit", bench.folder.path(), &[]).fails(&[]);
}

/// Extreme but legal numbers: a model or a refusal, never NaN or infinity.
#[test]
fn tables_of_extreme_numbers() {
    for table in [
        "z_m,theta_rad,sigma_m\n1e-300,0,1e-300\n1e-200,0,1e-200\n1,0,1\n2,0.3,1\n3,0.4,2\n",
        "z_m,theta_rad,sigma_m\n1,0,1e300\n2,0,1e300\n3,0,1e300\n4,0.3,1e300\n5,0.3,1e300\n",
        "z_m,theta_rad,sigma_m\n1e300,0,1\n2e300,0,1\n3e300,0,1\n4e300,0.3,2\n5e300,0.5,3\n",
        "z_m,theta_rad,sigma_m\n1,1.5707,1\n2,1.5707,1\n3,1.57,1\n4,1.57,2\n5,1.5,3\n",
        "z_m,theta_rad,sigma_m\n1,0,0.002\n1.5,0,0.002\n2,0,0.002\n3,0,0.002\n4,0,0.002\n",
        "z_m,theta_rad,sigma_m\n1,0,0.02\n1.5,0,0.01\n2,0,0.005\n3,0,0.002\n4,0,0.001\n",
        "z_m,theta_rad,sigma_m,n\n1,0,0.002,1\n1.5,0,0.003,1e300\n2,0,0.006,1\n3,0.5,0.02,1\n4,0.5,0.03,2\n",
    ] {
        Bench::empty().fit(table).fails_or_tells(&[]);
    }
}
