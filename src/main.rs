use kinoise::{io, measure::*};
fn main() {
    let p = std::env::args().nth(1).unwrap();
    let nogive = std::env::args().nth(2).is_some();
    let a = io::Assumed {
        intrinsics: if p.contains("second") { Some([585., 585., 319.5, 239.5]) } else { None },
        code: if p.contains("second") {
            Some(kinoise::frame::DepthCode::Disparity {
                offset: 3.3309,
                slope: -0.0030711,
                invalid: 2047,
            })
        } else {
            None
        },
        baseline_m: None,
    };
    let mut rec = io::open(std::path::Path::new(&p), &a).unwrap();
    for r in &rec.remarks {
        println!("R {r}");
    }
    if nogive {
        for v in &mut rec.views {
            v.notes.region = None;
        }
    }
    let b = Workbench::new(&rec.sensor, MeasureOptions::default());
    println!("view,z,theta,azim,paper_z,paper_theta,sig,sigperp,papersig,n,neff,cells,dt");
    for v in &rec.views {
        let t = std::time::Instant::now();
        match measure_view(v, &b) {
            Ok(m) => {
                let p = m.paper.unwrap();
                println!(
                    "{},{:.4},{:.3},{:.1},{:.4},{:.3},{:.2},{:.2},{:.2},{},{:.0},{},{:?} {:?} {:.2} {:?} {:?}",
                    m.name,
                    m.z_m,
                    m.theta_rad.to_degrees(),
                    m.azimuth_rad.to_degrees(),
                    p.z_m,
                    p.theta_rad.to_degrees(),
                    1e3 * m.whole.spread.spatial_m,
                    1e3 * m.whole.spread.perpendicular_m,
                    1e3 * p.sigma_m,
                    m.whole.n,
                    m.whole.n_effective,
                    m.cells.len(),
                    t.elapsed(),
                    m.exclusions,
                    m.correlation.sum_of_squares,
                    m.temporal_correlation,
                    m.notes
                )
            }
            Err(e) => println!("ERR {e}"),
        }
    }
}
