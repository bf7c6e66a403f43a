/* The equations of motion of a closed loop, one state at a time. ENTRIES is the number of entries of a state,
   COLUMNS the most columns that tables of a function have together; rates(), torques() and distances() stand below,
   functions of the numbers of robot and controller, which are data: robots that differ in these alone share the
   code. */

#include <math.h>
#include <stdint.h>

/* Piecewise polynomials of time, by the ends of their cells; highest power first. */
typedef struct {
    int64_t cells, powers, columns;
    const double *ends, *coefficients;
} table;

typedef struct {
    const double *numbers;
    int64_t tables;
    const table *table;
} loop;

static void rates(const double *p, const double *y, const double *s, double *dy);
static void torques(const double *p, const double *y, const double *s, double *tau);
static void distances(const double *p, const double *y, const double *s, double *d);

static int64_t cell_at(const table *of, double time)
{
    int64_t low = 0, high = of->cells - 1;
    while (low < high) {
        const int64_t middle = (low + high + 1) / 2;
        if (time < of->ends[middle])
            high = middle - 1;
        else
            low = middle;
    }
    return low;
}

static void columns_at(const loop *of, double time, double *s)
{
    for (int64_t number = 0; number < of->tables; number++) {
        const table *each = of->table + number;
        const int64_t cell = cell_at(each, time), width = each->columns;
        const double elapsed = time - each->ends[cell];
        const double *c = each->coefficients + cell * each->powers * width;
        for (int64_t column = 0; column < width; column++) {
            double value = c[column];
            for (int64_t power = 1; power < each->powers; power++)
                value = value * elapsed + c[power * width + column];
            *s++ = value;
        }
    }
}

/* Time derivatives of states, one after the other, at one time. */
void derivatives(const loop *of, double time, int64_t states, const double *y, double *dy)
{
    double s[COLUMNS + 1];
    columns_at(of, time, s);
    for (int64_t state = 0; state < states; state++)
        rates(of->numbers, y + state * ENTRIES, s, dy + state * ENTRIES);
}

/* Torques that a controller asks for in a state. */
void demand(const loop *of, double time, const double *y, double *tau)
{
    double s[COLUMNS + 1];
    columns_at(of, time, s);
    torques(of->numbers, y, s, tau);
}

/* Distance of a state to each boundary. */
void to_boundaries(const loop *of, const double *y, double *d)
{
    distances(of->numbers, y, 0, d);
}

/* Stages of an explicit Runge-Kutta step from the state y, first to last: k[stage] at time + c[stage] step. A row
   of a has as many coefficients as the width says. Leaves the state at the last stage in x, and returns whether its
   rates are finite. */
int64_t stages(const loop *of, double time, double step, const double *y, int64_t first, int64_t last, int64_t width,
            const double *a, const double *c, double *k, double *x)
{
    for (int64_t stage = first; stage <= last; stage++) {
        for (int64_t entry = 0; entry < ENTRIES; entry++) {
            double slope = 0;
            for (int64_t before = 0; before < stage; before++)
                slope += a[stage * width + before] * k[before * ENTRIES + entry];
            x[entry] = y[entry] + step * slope;
        }
        derivatives(of, time + c[stage] * step, 1, x, k + stage * ENTRIES);
    }
    double sum = 0;
    for (int64_t entry = 0; entry < ENTRIES; entry++)
        sum += k[last * ENTRIES + entry];
    return isfinite(sum) != 0;
}
