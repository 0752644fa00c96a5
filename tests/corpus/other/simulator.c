/* Read-out of the columns of a damaged CCD: every packet is followed through every pixel on its way to the register.
 *
 * Compiled by make.py (cc -O2 -shared -fPIC) and called from model.py. The only entry is read_out(), at the end.
 *
 * Physics
 *   Cloud     A packet of n electrons fills its pixel up to the height h(n) = ((n - d) / (w - d))^alpha, w the full
 *             well, d the notch: Rhodes et al. 2010, PASP 122, 439, eq. 1. Traps are uniform in 0 < h < 1.
 *   Instant   When a packet arrives, each filled trap has released its electron with probability 1 - exp(-1 / tau)
 *             since the packet before; what is released joins the packet; then each empty trap below the cloud's top
 *             takes one electron. Section 1 of the contract, and Massey et al. 2010, MNRAS 401, 371.
 *   Slow      Inside the cloud, whose height is that of the charge on arrival, the filled fraction f follows
 *             df/dt = (1 - f) / tau_c - f / tau during one line time; above it there is release alone: Massey et al.
 *             2014, MNRAS 439, 887, appendix A.
 *
 * Times are in units of one transfer. Nothing is skipped and no transfers are lumped together. What makes this
 * affordable is that the traps of a pixel need not be followed one by one: all traps between two heights have the same
 * history, so a pixel is a short stack of levels.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Species that slow capture can have; instant capture may have any number. */
#define MOST_SPECIES 4
/* Levels of a pixel under slow capture above which neighbours are merged whatever it takes. */
#define MOST_LEVELS 60
/* Instant capture: a remainder of a level below this height, as a fraction of the pixel, is added to its neighbour. */
#define THINNEST_LEVEL 1e-10
/* Slow capture: neighbours whose merger moves less charge than this, in electrons, are merged. */
#define LEAST_CHARGE_E 1e-8

/* Laid out as in model.py. */
typedef struct {
    double full_well_e;
    double notch_e;
    double well_fill_power;
    double capture_transfers; /* 0: instant */
    int species;
    const double *density_per_px;
    const double *release_transfers;
} Detector;

/* Columns that differ only behind the first rows_in_front rows, which hold the background. Laid out as in model.py. */
typedef struct {
    double background_e;
    int rows_in_front;
    int columns;
    int rows;
} Scene;

/* Traps from the top of the level below (or the bottom of the pixel) to `top`, which share one history. */
typedef struct {
    double top;
    union {
        int last_packet;             /* instant: the packet that filled them all */
        double filled[MOST_SPECIES]; /* slow: the filled fraction of each species */
    };
} Level;

/* Levels from the bottom up; traps above the last of them were never filled. */
typedef struct {
    int count;
    int room;
    Level *levels;
} Pixel;

/* A detector, with what depends on nothing else worked out once. */
typedef struct Readout Readout;
struct Readout {
    const Detector *detector;
    double (*pass)(Pixel *pixel, double charge_e, int packet, const Readout *readout);
    /* Instant: electrons that a pixel whose traps were all filled still holds, by the number of transfers since. */
    double *held_e;
    /* Slow, above the cloud: fraction of the filled traps that are still filled after one transfer. */
    double kept[MOST_SPECIES];
    /* Slow, inside the cloud: filled fraction in equilibrium, and how much of the distance to it is left after one. */
    double settled[MOST_SPECIES];
    double relaxed[MOST_SPECIES];
};

static void *allocate(void *old, size_t bytes)
{
    void *memory = realloc(old, bytes > 0 ? bytes : 1);
    if (memory == NULL)
        abort();
    return memory;
}

static double cloud_height(const Detector *detector, double charge_e)
{
    if (charge_e <= detector->notch_e)
        return 0.0;
    double fullness = (charge_e - detector->notch_e) / (detector->full_well_e - detector->notch_e);
    double height = pow(fullness, detector->well_fill_power);
    return height < 1.0 ? height : 1.0;
}

/* ------------------------------------------------------------------------------------------------ levels of a pixel */

static double bottom_of(const Pixel *pixel, int index)
{
    return index > 0 ? pixel->levels[index - 1].top : 0.0;
}

static void insert_level(Pixel *pixel, int index, Level level)
{
    if (pixel->count == pixel->room) {
        pixel->room = pixel->room > 0 ? 2 * pixel->room : 8;
        pixel->levels = allocate(pixel->levels, pixel->room * sizeof(Level));
    }
    memmove(pixel->levels + index + 1, pixel->levels + index, (pixel->count - index) * sizeof(Level));
    pixel->levels[index] = level;
    pixel->count++;
}

static void remove_levels(Pixel *pixel, int first, int number)
{
    int after = first + number;
    memmove(pixel->levels + first, pixel->levels + after, (pixel->count - after) * sizeof(Level));
    pixel->count -= number;
}

static void copy_pixel(Pixel *to, const Pixel *from)
{
    if (to->room < from->count) {
        to->room = from->count + 8;
        to->levels = allocate(to->levels, to->room * sizeof(Level));
    }
    if (from->count > 0)
        memcpy(to->levels, from->levels, from->count * sizeof(Level));
    to->count = from->count;
}

/* -------------------------------------------------------------------------------------------------- instant capture */

static double released_since_last_packet(const Pixel *pixel, int packet, const double *held_e)
{
    double released_e = 0.0;
    for (int i = 0; i < pixel->count; i++) {
        int age = packet - pixel->levels[i].last_packet;
        released_e += (pixel->levels[i].top - bottom_of(pixel, i)) * (held_e[age - 1] - held_e[age]);
    }
    return released_e;
}

/* Electrons that the empty traps below a height can take: all of them, less those that are still filled. */
static double empty_below(const Pixel *pixel, double height, int packet, const double *held_e)
{
    double empty_e = height * held_e[0];
    for (int i = 0; i < pixel->count && bottom_of(pixel, i) < height; i++) {
        double top = pixel->levels[i].top < height ? pixel->levels[i].top : height;
        empty_e -= (top - bottom_of(pixel, i)) * held_e[packet - pixel->levels[i].last_packet];
    }
    return empty_e;
}

/* All traps below a height are filled now, whatever they were before: one level takes the place of those it covers. */
static void fill_below(Pixel *pixel, double height, int packet)
{
    int covered = 0;
    while (covered < pixel->count && pixel->levels[covered].top <= height)
        covered++;
    if (covered < pixel->count && pixel->levels[covered].top - height < THINNEST_LEVEL)
        height = pixel->levels[covered++].top;
    remove_levels(pixel, 0, covered);
    insert_level(pixel, 0, (Level){.top = height, .last_packet = packet});
}

/* A packet passes a pixel; returns its charge when it leaves. */
static double pass_with_instant_capture(Pixel *pixel, double charge_e, int packet, const Readout *readout)
{
    charge_e += released_since_last_packet(pixel, packet, readout->held_e);
    double height = cloud_height(readout->detector, charge_e);
    if (height > 0.0) {
        charge_e -= empty_below(pixel, height, packet, readout->held_e);
        fill_below(pixel, height, packet);
    }
    return charge_e;
}

/* ----------------------------------------------------------------------------------------------------- slow capture */

/* Makes a level end at a height, so that each level is either inside the cloud or above it. */
static void split_at(Pixel *pixel, double height)
{
    int index = 0;
    while (index < pixel->count && pixel->levels[index].top < height)
        index++;
    if (index == pixel->count) {
        insert_level(pixel, index, (Level){.top = height, .filled = {0.0}});
    } else if (pixel->levels[index].top > height) {
        Level lower = pixel->levels[index];
        lower.top = height;
        insert_level(pixel, index, lower);
    }
}

static void merge_with_next(Pixel *pixel, int index, int species)
{
    Level *lower = &pixel->levels[index], *upper = lower + 1;
    double below = lower->top - bottom_of(pixel, index), above = upper->top - lower->top;
    for (int s = 0; s < species; s++)
        upper->filled[s] = (below * lower->filled[s] + above * upper->filled[s]) / (below + above);
    remove_levels(pixel, index, 1);
}

/* Electrons that change their height, at most, when a level and the next become one. */
static double moved_by_merger(const Pixel *pixel, int index, const Detector *detector)
{
    const Level *lower = &pixel->levels[index], *upper = lower + 1;
    double below = lower->top - bottom_of(pixel, index), above = upper->top - lower->top;
    double difference = 0.0;
    for (int s = 0; s < detector->species; s++)
        difference += detector->density_per_px[s] * fabs(lower->filled[s] - upper->filled[s]);
    return (below < above ? below : above) * difference;
}

/* Under slow capture no packet wipes out the past, so levels would pile up: those that have become alike are merged. */
static void merge_alike(Pixel *pixel, const Detector *detector)
{
    double limit_e = LEAST_CHARGE_E;
    do {
        for (int i = 0; i + 1 < pixel->count;) {
            if (moved_by_merger(pixel, i, detector) < limit_e)
                merge_with_next(pixel, i, detector->species);
            else
                i++;
        }
        limit_e *= 10.0;
    } while (pixel->count > MOST_LEVELS);
}

static double pass_with_slow_capture(Pixel *pixel, double charge_e, int packet, const Readout *readout)
{
    (void)packet; /* every packet comes one transfer after the one before; which it is does not matter */
    const Detector *detector = readout->detector;
    double height = cloud_height(detector, charge_e);
    if (height > 0.0)
        split_at(pixel, height);
    double gained_e = 0.0;
    for (int i = 0; i < pixel->count; i++) {
        Level *level = &pixel->levels[i];
        double thickness = level->top - bottom_of(pixel, i);
        for (int s = 0; s < detector->species; s++) {
            double before = level->filled[s];
            double after = level->top <= height
                               ? readout->settled[s] + (before - readout->settled[s]) * readout->relaxed[s]
                               : before * readout->kept[s];
            gained_e += detector->density_per_px[s] * thickness * (before - after);
            level->filled[s] = after;
        }
    }
    merge_alike(pixel, detector);
    return charge_e + gained_e;
}

/* ---------------------------------------------------------------------------------------------------------- columns */

static void prepare_instant(Readout *readout, int transfers)
{
    const Detector *detector = readout->detector;
    readout->pass = pass_with_instant_capture;
    readout->held_e = allocate(NULL, transfers * sizeof(double));
    for (int age = 0; age < transfers; age++) {
        readout->held_e[age] = 0.0;
        for (int s = 0; s < detector->species; s++)
            readout->held_e[age] += detector->density_per_px[s] * exp(-age / detector->release_transfers[s]);
    }
}

static void prepare_slow(Readout *readout)
{
    const Detector *detector = readout->detector;
    readout->pass = pass_with_slow_capture;
    for (int s = 0; s < detector->species; s++) {
        double release_rate = 1.0 / detector->release_transfers[s], capture_rate = 1.0 / detector->capture_transfers;
        readout->kept[s] = exp(-release_rate);
        readout->relaxed[s] = exp(-(capture_rate + release_rate));
        readout->settled[s] = capture_rate / (capture_rate + release_rate);
    }
}

/* The packet of a row passes the pixel it was in, and every pixel between it and the register: row + 1 transfers. */
static double to_the_register(Pixel *pixels, int row, double charge_e, const Readout *readout)
{
    for (int p = row; p >= 0; p--)
        charge_e = readout->pass(&pixels[p], charge_e, row, readout);
    return charge_e;
}

/* Charge that arrives at the register: charge_e and read_e, in electrons, hold one column of scene->rows after the
 * other. Returns 0, or 1 where slow capture has too many species. */
int read_out(const Detector *detector, const Scene *scene, const double *charge_e, double *read_e)
{
    int length = scene->rows_in_front + scene->rows;
    Readout readout = {.detector = detector};
    if (detector->capture_transfers <= 0.0)
        prepare_instant(&readout, length + 1);
    else if (detector->species <= MOST_SPECIES)
        prepare_slow(&readout);
    else
        return 1;
    Pixel *after_front = allocate(NULL, length * sizeof(Pixel)), *pixels = allocate(NULL, length * sizeof(Pixel));
    memset(after_front, 0, length * sizeof(Pixel));
    memset(pixels, 0, length * sizeof(Pixel));
    /* Rows in front are the same in each column: they are read once. Without background they carry nothing. */
    for (int row = 0; row < scene->rows_in_front && scene->background_e > 0.0; row++)
        to_the_register(after_front, row, scene->background_e, &readout);
    for (int column = 0; column < scene->columns; column++) {
        for (int p = 0; p < length; p++)
            copy_pixel(&pixels[p], &after_front[p]);
        for (int i = 0; i < scene->rows; i++) {
            int cell = column * scene->rows + i;
            read_e[cell] = to_the_register(pixels, scene->rows_in_front + i, charge_e[cell], &readout);
        }
    }
    for (int p = 0; p < length; p++) {
        free(after_front[p].levels);
        free(pixels[p].levels);
    }
    free(after_front);
    free(pixels);
    free(readout.held_e);
    return 0;
}
