"""Files of radiation programs for tests/suite/radiation_files.rs: made-up numbers in the layouts of the programs.

Run in this folder: python3 make.py. The layouts are those of SPENVIS 4.6.13, OMERE 5.9.1 and CREME96; see the comments
at the beginning of src/io/radiation_file/*.rs. The .stderr files beside broken/* are what the readers say.
"""

import math

ENERGIES_MEV = [1, 10, 30, 100, 300]
ECSV = "# %ECSV 1.0\n# ---\n# datatype:\n# - {{name: {}, {}}}\n# - {{name: {}, {}}}\n# schema: astropy-2.0\n"


def lines(name, written, end="\n", encoding="utf-8", mark=b""):
    with open(name, "wb") as file:
        file.write(mark + (end.join(written) + end).encode(encoding))


def text(name, written):
    with open(name, "w") as file:
        file.write(written)


def ecsv(name, one, other, rows):
    names = [one[0], other[0]]
    text(name, ECSV.format(*one, *other) + " ".join(names) + "\n" + rows)


def row(values):
    return "  " + ",  ".join(f"{value:.4E}" for value in values)


# SPENVIS

def block(meta, variables, rows, columns, more, last):
    notes = ["'PS Annotation',  4,  0", "'Mission start: 01/01/2030 00:00:00'", " 0.05, 0.00, 0.00",
             "'Mission end: 31/12/2034 00:00:00'", " 0.95, 0.00, 1.00"]
    header = 2 + len(meta) + len(notes) + len(variables)
    counts = [header, 1, len(meta), len(notes), len(variables), columns, len(rows), more]
    first = ["'*'," + ",".join(f"{count:6d}" for count in counts), "'SPENVIS 4.6.13.3554          - 01-Jan-2029 00:00:00'"]
    return first + meta + notes + variables + rows + ["'End of File'" if last else "'End of Block'"]


def mission(module, segments=1):
    return ["'PRJ_DEF', -1,'SAMPLE'", "'PRJ_HDR', -1,'Made-up numbers, rad-hard camera'", f"'MOD_ABB', -1,'{module}'",
            "'MIS_PLA',  1,    3,' '", f"'MIS_NTR',  1,    {segments},' '", "'MIS_STA',  1,  29220.00000000,' '",
            "'MIS_END',  1,  31046.00000000,' '", "'MIS_DUR',  1, 1.826000E+03,'days'"]


def orbit(name, start, end):
    return [f"'ORB_HDR', -1,'{name}'", "'ORB_TYP', -1,'GEN'", f"'ORB_MJD',  1,  {start:.8f},' '",
            "'ORB_DUR',  1, 3.000000E+01,'days'", f"'ORB_TSE',  1,  {end:.8f},' '"]


def trapped(segment, species, model, scale, more, last, segments=1):
    meta = mission("TRP", segments) + orbit(*segment) + [
        f"'TRP_MOD', -1,'{model}'", "'TRP_OMN', 1,  1,' '", f"'PLT_HDR', -1,'{model} Orbit averaged flux'",
        f"'SPECIES', -1,'{species}'"]
    variables = ["'Energy','MeV', 1,'Energy'", "'IFlux','cm!u-2!n s!u-1!n', 1,'Integral Flux'",
                 "'DFlux','cm!u-2!n s!u-1!n MeV!u-1!n', 1,'Differential Flux'"]
    table = zip(ENERGIES_MEV, [400, 200, 100, 50, 0], [30, 8, 2, 0.3, 0])
    rows = [row([energy, scale * above, scale * at]) for energy, above, at in table]
    return block(meta, variables, rows, 3, more, last)


IONS = "'SPECIES',-3,'H ','He','Li'"


def solar():
    meta = mission("SEP") + ["'SEP_MOD', -1,'ESP-PSYCHIC total fluence'", "'SEP_PRB',  1,  95.0,'%'",
                             "'SEP_OMN',  1, 1, ' '", "'PLT_HDR', -1,'ESP-PSYCHIC total fluence: solar protons'"]
    table = list(zip(ENERGIES_MEV, [1e11, 2e10, 5e9, 5e8, 5e7], [5e10, 2e9, 2e8, 1e7, 3e5]))
    variables = ["'Energy','MeV', 1,'Energy'", "'IFlux','cm!u-2!n', 1,'Integral Fluence'",
                 "'DFlux','cm!u-2!n MeV!u-1!n', 1,'Differential Fluence'",
                 "'Attenuation',' ', 1,'Orbit Averaged Proton Attenuation Factor'",
                 "'Exposure','hrs', 1,'Proton Exposure Time'"]
    protons = block(meta + ["'SPECIES', -1,'proton'"], variables,
                    [row(values) + ", 0.2138, 1.2782E+04" for values in table], 5, 1, False)
    variables = ["'Energy','MeV/n', 1,'Energy'", "'IFlux','cm!u-2!n', 3,'Integral Fluence of ','SPECIES'",
                 "'DFlux','cm!u-2!n (MeV/n)!u-1!n', 3,'Differential Fluence of ','SPECIES'"]
    rows = [row([energy, i, i / 30, i / 1e9, d, d / 30, d / 1e9]) for energy, i, d in table[:2]]
    return protons + block(meta + [IONS], variables, rows, 7, 0, True)


def spenvis():
    polar, transfer, station = ("Polar, low", 29220, 31046), ("Transfer", 29220, 29585.2), ("Station", 29585.2, 31046)
    one = trapped(polar, "proton", "AP-8 MIN", 1, 1, False) + trapped(polar, "e-", "AE-8 MAX", 1e4, 0, True)
    lines("spenvis_trapped.txt", one)
    lines("spenvis_trapped_windows.txt", one, end="\r\n", mark=b"\xef\xbb\xbf")
    lines("spenvis_two_segments.txt",
          trapped(transfer, "proton", "AP-8 MIN", 10, 3, False, 2) + trapped(transfer, "e-", "AE-8 MAX", 1, 2, False, 2)
          + trapped(station, "proton", "AP-8 MIN", 1, 1, False, 2) + trapped(station, "e-", "AE-8 MAX", 1, 0, True, 2))
    lines("spenvis_solar.txt", solar())
    meta = mission("GCR") + orbit(*polar) + ["'GCR_MOD', -1,'CREME96'", "'GCR_OMN',  1,  0,' '",
                                             "'PLT_HDR', -1,'ion spectrum (GCR)'", IONS]
    variables = ["'Energy','MeV/n', 1,'Energy'",
                 "'IFlux','m!u-2!n sr!u-1!n s!u-1!n', 3,'Integral Flux of ','SPECIES'",
                 "'DFlux','m!u-2!n sr!u-1!n s!u-1!n (MeV/n)!u-1!n', 3,'Differential Flux of ','SPECIES'"]
    table = [(1, 1000, .1), (100, 900, .8), (1000, 500, .4), (100000, 1, 1e-5)]
    rows = [row([energy, i, i / 8, i / 1e3, d, d / 8, d / 1e3]) for energy, i, d in table]
    lines("spenvis_cosmic.txt", block(meta, variables, rows, 7, 0, True))

    def changed(name, written, old, new):
        lines(f"broken/{name}", [line.replace(old, new) for line in written])

    worst_day = [line.replace("'cm!u-2!n'", "'m!u-2!n sr!u-1!n s!u-1!n'") for line in solar()]
    changed("spenvis_worst_day.txt", worst_day, "'MOD_ABB', -1,'SEP'", "'MOD_ABB', -1,'FLA'")
    changed("spenvis_value.txt", one, "2.0000E+02", "********")
    changed("spenvis_unit.txt", one, "'IFlux','cm!u-2!n s!u-1!n'", "'IFlux','cm!u-2!n rad!u-1!n'")
    changed("spenvis_rising.txt", one, " 5.0000E+01,  3.0000E-01", " 1.5000E+02,  3.0000E-01")
    lines("broken/spenvis_cut.txt", one[:-3])
    lines("broken/spenvis_rows_missing.txt", one[:27] + one[28:])
    lines("broken/spenvis_electrons.txt", trapped(polar, "e-", "AE-8 MAX", 1, 0, True))
    lines("broken/spenvis_two_totals.txt", [line.replace("End of File", "End of Block") for line in solar()] + solar())
    lines("broken/depth_spenvis_spectrum.txt", one)
    meta = mission("SH2") + ["'PLT_TYP', -1,'SUMMARY'", "'PLT_HDR', -1,'4pi Dose at Centre of Al Spheres'",
                             "'PLT_LEG', -2,'Total','Electrons'"]
    variables = ["'Thick','mm', 1,'Aluminium Absorber Thickness'", "'Dose','rad', 2,'Dose in Si'"]
    lines("broken/depth_spenvis.txt", block(meta, variables, [row([1, 10, 5]), row([2, 5, 2])], 3, 0, True))


# OMERE

DISPLACEMENT = """#==================================================================
# OMERE 5.9.1.41289 - Displacement damage 
# 
# File : sample\\Si_equiFlux.fle
# Creation : 2029/01/01    00:00:00
#
#==================================================================
# Start mission : 2030 
# Lifetime : 5 year(s).
# Inclination :                         98.000°

# Trapped electrons :
# Model : AE8 Max

# Trapped protons :
# Model : AP8 Min

# Solar protons : ESP
# Confidence level = 90.000

# Cutoff model : Störmer
#***************** EQUIVALENT FLUENCES *****************

# THICKNESS           ENVIRONMENT_PROTONS_AND_ELECTRONS
#                            in_1_MeV_ELECTRONS 
#     mm                 cm-2
 1.00e-02            2.000e+00
 1.00e-01            1.000e+00


#***************** INPUT FLUENCES *****************

#  *********ELECTRONS*********        
# ENERGY           DIFFERENTIAL_FLUENCE 
#  MeV                   /(MeV.cm2) 
 4.00e-02            1.00e+15
 1.00e+00            3.00e+12
# ***********PROTONS**********   
# ENERGY           DIFFERENTIAL_FLUENCE 
#  MeV                  /(MeV.cm2) 
 1.00e-01            2.00e+13
 1.00e+00            2.00e+11
 1.00e+00            3.00e+11
 1.00e+01            5.00e+09
 1.00e+02            2.00e+08


#***************** NIEL CURVES *****************
#  *******FOR ELECTRONS*********        
#   ENERGY                NIEL 
#    MeV               MeV.cm2.g-1 
 1.00e+01            9.00e-05
 1.50e+01            1.00e-04
""".split("\n")[:-1]

TRAPPED = """# OMERE 5.9.1.41289 - Trapped protons
# Lifetime : 18 month(s).
# Trapped protons :
# Model : AP8 Min
#
# Energy         Diff flux        Integ flux
# MeV            cm-2.s-1.MeV-1   cm-2.s-1
 1.0e+00         3.0e+01          4.0e+02
 1.0e+01         8.0e+00          2.0e+02
 1.0e+02         3.0e-01          5.0e+01
""".split("\n")[:-1]

IONISING = """# OMERE 5.9 - Dose
# Thickness    Trapped     Trapped     Total
#   Al        electrons    protons     Dose
#  mm_Al          rad         rad      rad
 1.0e-01  2.0e+05 1.0e+04 2.1e+05
 1.0e+00  2.0e+04 1.0e+03 2.1e+04
""".split("\n")[:-1]


def omere():
    lines("omere_displacement.fle", DISPLACEMENT, end="\r\n", encoding="latin-1")
    lines("omere_trapped.flx", TRAPPED)
    lines("broken/omere_electrons.flx", [line.replace("protons", "electrons") for line in TRAPPED])
    titles = ("***PROTONS***", "***ELECTRONS***")
    lines("broken/omere_no_particle.fle", [line for line in DISPLACEMENT if not any(title in line for title in titles)])
    lines("broken/omere_word.flx", TRAPPED[:-1] + [" 1.0e+02         n/a              5.0e+01"])
    lines("broken/omere_negative.flx", TRAPPED[:-1] + [" 1.0e+02         3.0e-01          -5.0e+01"])
    lines("broken/depth_omere.dos", IONISING)
    lines("broken/depth_omere_equivalent.fle", DISPLACEMENT)


# CREME

def flx(nuclei, end="UNSHIELDED    2030.000  0 0  210 1", first=1):
    written = ["  3 SAMPLE.FLX 210 1", "%Created by CREME96:FLUX_DRIVER Version  210", "%Made-up numbers", "%",
               f"  1.0000E-01  1.0000E+05      7 {first:6d} {nuclei:6d}  {end}", ""]
    for nucleus in range(1, nuclei + 1):
        fluxes = [f"  {1e3 * math.exp(-0.5 * place) / nucleus:.4E}" for place in range(7)]
        written += ["".join(fluxes[start:start + 3]) for start in range(0, 7, 3)] + [""]
    return written


def creme():
    lines("creme.flx", flx(2))
    lines("creme.trp", ["  1 SAMPLE.TRP 210 1", "%AP8MIN",
                        "  1.0000E+00  1.0000E+03      4      1      1  UNSHIELDED    1964.000  29  210 1",
                        "  1.0E+02 1.0E+01 1.0E+00 1.0-101"])
    lines("creme_shielded.tfx", flx(2, "ALUMINUM  100.0"))
    lines("broken/creme_cut.flx", flx(2)[:-2])
    lines("broken/creme_worst_week.flx", flx(1, "UNSHIELDED    2030.000  2 0  210 1"))
    lines("broken/creme_let.let", flx(1, "SILICON  210 1"))
    lines("broken/creme_no_protons.flx", flx(2, first=2))
    lines("broken/creme_header.flx", [line.replace("      7 ", " seven ") for line in flx(1)])


# Tables

def tables():
    text("spectrum.csv", "# duration_yr: 5\nenergy_mev,integral_cm2,differential_cm2_mev\n1,1e11,5e10\n10,2e10,2e9\n"
         "100,5e8,1e7\n")
    ecsv("spectrum.ecsv", ("energy_mev", "unit: keV, datatype: float64"),
         ("differential_cm2_s_mev", "unit: 1 / (GeV m2 s sr), datatype: float64"), "1000.0 5.0\n10000.0 0.5\n")
    text("dose_history.csv", "t_yr,dose_mev_g\n0,0\n1.5,3e6\n3,3e6\n")
    ecsv("dose_history.ecsv", ("date", "datatype: string"), ("rate_mev_g_yr", "unit: keV / (g d), datatype: float64"),
         "2030-06-01 1000\n2031-06-01T12:00:00 500\n")
    text("dose_depth.csv", "thickness_mm,dose_mev_g\n1,5e8\n10,5e7\n100,5e6\n")
    text("dose_depth_rate.csv", "areal_density_g_cm2 [kg/m2];dose_mev_g_yr\n10;5e8\n20;5e7\n")
    text("sectors.csv", "weight,thickness_mm\n1,10\n2,20\n1,0\n")
    ecsv("sectors.ecsv", ("weight", "unit: sr, datatype: float64"),
         ("areal_density_g_cm2", "unit: g / cm2, datatype: float64"), "6.28 2.7\n6.28 5.4\n")
    broken = {
        "spectrum_columns": "energy_mev,integral_cm-2\n1,2\n2,1\n",
        "spectrum_both_times": "energy_mev,integral_cm2,integral_cm2_s\n1,2,1\n2,1,1\n",
        "spectrum_negative": "energy_mev,integral_cm2\n1,2\n2,-1\n",
        "spectrum_order": "energy_mev,integral_cm2\n1,2\n1,1\n",
        "spectrum_zero_energy": "energy_mev,integral_cm2\n0,2\n1,1\n",
        "spectrum_one_row": "energy_mev,integral_cm2\n1,2\n",
        "spectrum_unit": "energy_mev [J],integral_cm2\n1,2\n2,1\n",
        "spectrum_duration": "# duration_yr: -5\nenergy_mev,integral_cm2\n1,2\n2,1\n",
        "spectrum_empty": "\n \n",
        "spectrum_word": "energy_mev,integral_cm2\n1,2\n2,\n",
        "history_falling": "t_yr,dose_mev_g\n0,0\n1,2e6\n2,1e6\n",
        "history_order": "date,dose_mev_g\n2031-01-01,0\n2030-01-01,1\n",
        "history_no_date": "date,dose_mev_g\n2031-01-01,0\nsoon,1\n",
        "history_two_times": "date,t_yr,dose_mev_g\n2031-01-01,0,0\n2032-01-01,1,1\n",
        "history_one_row": "t_yr,dose_mev_g\n0,0\n",
        "history_before_launch": "t_yr,dose_mev_g\n-1,0\n0,0\n",
        "history_column": "t_yr,dose\n0,0\n1,1\n",
        "depth_rad": "thickness_mm,dose_rad\n1,5e3\n10,5e2\n",
        "depth_gray": "thickness_mm,dose_mev_g [Gy]\n1,5e3\n10,5e2\n",
        "depth_order": "thickness_mm,dose_mev_g\n10,5e3\n1,5e2\n",
        "sectors_negative": "weight,thickness_mm\n1,10\n-1,10\n",
        "sectors_zero": "weight,thickness_mm\n0,10\n0,10\n",
        "sectors_no_rows": "weight,thickness_mm\n",
        "sectors_both_depths": "weight,thickness_mm,areal_density_g_cm2\n1,10,2.7\n",
        "sectors_thickness": "weight,thickness_mm\n1,thick\n",
    }
    for name, written in broken.items():
        text(f"broken/{name}.csv", written)
    with open("broken/spectrum_binary.csv", "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n\x00\x00")


spenvis()
omere()
creme()
tables()
