//! Measurements as flight gives them: trap densities, CTI, dates as days.

use ctiplan::analysis::measurement::DataSet;
use ctiplan::io::table::Table;
use ctiplan::mission::Mission;
use ctiplan::model::Model;
use ctiplan::model::predict::predict;

fn mission() -> Mission {
    Mission::read("missions/snap_l2.toml").unwrap()
}

fn data(text: &str) -> DataSet {
    DataSet::of(Table::parse("data.csv", text).unwrap(), &mission()).unwrap_or_else(|error| panic!("{error}"))
}

fn refusal(text: &str) -> String {
    DataSet::of(Table::parse("data.csv", text).unwrap(), &mission()).expect_err("a refusal").to_string()
}

fn predicted(text: &str) -> Vec<f64> {
    let data = data(text);
    let questions: Vec<_> = data.rows.iter().map(|row| row.question(data.observable)).collect();
    predict(&Model::new(&mission()), &questions).unwrap()
}

#[test]
fn trap_densities_are_those_of_the_model_of_one_species_and_of_all() {
    let found = predicted(
        "# observable: trap_density\nt_yr,species,value,sigma\n2.0,VV,0.1,0.01\n2.0,CO,0.1,0.01\n2.0,,0.1,0.01\n4.5,Ci,0.1,0.01\n",
    );
    let traps = |t_yr: f64| -> Vec<f64> {
        Model::new(&mission()).traps(t_yr).unwrap().iter().map(|species| species.density_per_px).collect()
    };
    let (two, later) = (traps(2.0), traps(4.5));
    assert_eq!(found, [two[1], two[2], two.iter().sum(), later[0]]);
    let all = predicted("# observable: trap_density\nt_yr,value,sigma\n2.0,0.1,0.01\n");
    assert_eq!(all, [two.iter().sum::<f64>()]);
    let unknown = refusal("# observable: trap_density\nt_yr,species,value,sigma\n2.0,V2,0.1,0.01\n");
    assert!(unknown.contains("no species \"V2\"; it has: Ci, VV, CO"), "{unknown}");
}

#[test]
fn cti_is_what_a_packet_loses_in_a_transfer_or_what_lies_behind_an_edge() {
    let conditions = "t_yr,signal_e,transfers,";
    let rows = [(3.0, 500.0, 1000), (5.0, 2000.0, 400)];
    let table = |observable: &str| {
        let rows: String = rows.iter().map(|(t, s, n)| format!("{t},{s},{n},0.1,1\n")).collect();
        format!("# observable: {observable}\n{conditions}value,sigma\n{rows}")
    };
    let (cti, charge) = (predicted(&table("cti")), predicted(&table("packet_charge")));
    for ((cti, charge_e), (_, signal_e, transfers)) in cti.iter().zip(charge).zip(rows) {
        assert!((signal_e * (1.0 - cti).powi(transfers) / charge_e - 1.0).abs() < 1e-12);
        assert!(*cti > 1e-7 && *cti < 1e-4, "{cti}");
    }
    // Of an edge: the sum of the extended pixel edge response, over transfers and charge.
    let edge = predicted(
        "# observable: cti\nt_yr,signal_e,transfers,block_px,first_px,last_px,value,sigma\n4.0,1000,1500,200,1,3,0.1,1\n\
         4.0,1000,1500,200,2,3,0.1,1\n",
    );
    let eper = predicted(
        "# observable: eper\nt_yr,signal_e,transfers,block_px,trail_px,value,sigma\n4.0,1000,1500,200,1,1,1\n\
         4.0,1000,1500,200,2,1,1\n4.0,1000,1500,200,3,1,1\n",
    );
    assert!((edge[0] / (eper.iter().sum::<f64>() / 1.5e6) - 1.0).abs() < 1e-9);
    assert!((edge[1] / ((eper[1] + eper[2]) / 1.5e6) - 1.0).abs() < 1e-9);
    let header = "# observable: cti\nt_yr,signal_e,transfers,";
    assert!(
        refusal(&format!("{header}block_px,first_px,value,sigma\n4.0,1000,1500,200,1,0.1,1\n")).contains("`last_px`")
    );
    assert!(
        refusal(&format!("{header}first_px,last_px,value,sigma\n4.0,1000,1500,1,3,0.1,1\n")).contains("`block_px`")
    );
    let backwards = refusal(&format!("{header}block_px,first_px,last_px,value,sigma\n4.0,1000,1500,200,4,3,0.1,1\n"));
    assert!(backwards.contains("first_px is 4, behind last_px, 3"), "{backwards}");
}

#[test]
fn days_are_dates() {
    // 2011-01-01 is MJD 55562; the mission is launched on 2009-01-01.
    let by = |column: &str, value: &str| {
        let row = &data(&format!("# observable: dose\n{column},value,sigma\n{value},1e6,1e4\n")).rows[0];
        row.at.t_yr
    };
    let date = by("date", "2011-01-01");
    assert!((date - 730.0 / 365.25).abs() < 1e-12);
    assert_eq!((by("mjd", "55562"), by("jd", "2455562.5")), (date, date));
    assert!((by("mjd", "55562.5") - date - 0.5 / 365.25).abs() < 1e-9);
    let early = refusal("# observable: dose\nmjd,value,sigma\n51000,1e6,1e4\n");
    assert!(early.contains("mjd") && early.contains("before launch, 2009-01-01"), "{early}");
    let varying = data("# observable: dose\nmjd,value,sigma\n55562,1e6,1e4\n55662,1e6,1e4\n").varying;
    assert_eq!(varying, ["t_yr"]);
}
