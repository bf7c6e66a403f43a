/* Several samples at once, one a lane of a vector register; GCC and Clang. INPUTS and OUTPUTS are defined above,
   group() below. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__AVX512F__) && defined(__AVX512DQ__)
#define LANES 8
#define VECTOR_LIBRARY(arguments, f) _ZGVeN8##arguments##_##f
#elif defined(__AVX2__)
#define LANES 4
#define VECTOR_LIBRARY(arguments, f) _ZGVdN4##arguments##_##f
#else
#define LANES 2
#endif

/* glibc brings the functions of math.h for vectors, as good as 1 to 2 units in the last place. */
#if !defined(VECTOR_LIBRARY) || !defined(__x86_64__) || !defined(__GLIBC__)
#undef VECTOR_LIBRARY
#elif __GLIBC__ == 2 && __GLIBC_MINOR__ < 35
#undef VECTOR_LIBRARY
#endif

typedef double reals __attribute__((vector_size(8 * LANES)));
typedef int64_t integers __attribute__((vector_size(8 * LANES)));
typedef double unaligned __attribute__((vector_size(8 * LANES), aligned(8), may_alias));

static inline reals load(const double *from) { return *(const unaligned *)from; }

/* Results are more than the caches hold: whole lines go past them, to rows that begin at whole vectors, in half the
   time. Half a line, a vector of AVX2, does not: of the rows of a run, memory would write each half by itself, which
   takes twice as long as a line that the caches collect. */
#if LANES == 8
#include <immintrin.h>
static inline void store(double *to, reals x) { _mm512_stream_pd(to, (__m512d)x); }
static inline void finish(void) { _mm_sfence(); }
#else
static inline void store(double *to, reals x) { *(reals *)to = x; }
static inline void finish(void) {}
#endif

static inline reals spread(double x) { return x - (reals){0}; }
static inline integers spread_integer(int64_t x) { return x - (integers){0}; }
static inline reals choose(integers where, reals a, reals b) { return (reals)((where & (integers)a) | (~where & (integers)b)); }
static inline integers choose_integer(integers where, integers a, integers b) { return (where & a) | (~where & b); }

static inline reals counted(integers x)
{
    reals y;
    for (int lane = 0; lane < LANES; lane++)
        y[lane] = (double)x[lane];
    return y;
}

static inline int any(integers where)
{
    int64_t found = 0;
    for (int lane = 0; lane < LANES; lane++)
        found |= where[lane];
    return found != 0;
}

/* Number of increasing nodes that a value is not below; all of them for NaN, as of numpy.searchsorted. */
static inline integers search(const double *nodes, size_t count, reals x)
{
    integers index;
    for (int lane = 0; lane < LANES; lane++) {
        size_t low = 0, high = count;
        while (low < high) {
            const size_t middle = (low + high) / 2;
            if (x[lane] < nodes[middle])
                high = middle;
            else
                low = middle + 1;
        }
        index[lane] = (int64_t)low;
    }
    return index;
}
static inline reals each_take(const double *table, integers index)
{
    reals y;
    for (int lane = 0; lane < LANES; lane++)
        y[lane] = table[index[lane]];
    return y;
}

static inline reals each_fabs(reals x) { return (reals)((integers)x & INT64_MAX); }
static inline reals each_copysign(reals x, reals y)
{
    return (reals)(((integers)x & INT64_MAX) | ((integers)y & INT64_MIN));
}
static inline reals each_maximum(reals a, reals b) { return choose((a >= b) | (a != a), a, b); }
static inline reals each_minimum(reals a, reals b) { return choose((a <= b) | (a != a), a, b); }
static inline integers each_maximum_integer(integers a, integers b) { return choose_integer(a >= b, a, b); }
static inline integers each_minimum_integer(integers a, integers b) { return choose_integer(a <= b, a, b); }
static inline reals each_sqrt(reals x)
{
    reals y;
    for (int lane = 0; lane < LANES; lane++)
        y[lane] = sqrt(x[lane]);
    return y;
}

#ifdef VECTOR_LIBRARY
#define UNARY(f)                                                                                                       \
    reals VECTOR_LIBRARY(v, f)(reals);                                                                                 \
    static inline reals each_##f(reals x) { return VECTOR_LIBRARY(v, f)(x); }
#define BINARY(f)                                                                                                      \
    reals VECTOR_LIBRARY(vv, f)(reals, reals);                                                                         \
    static inline reals each_##f(reals x, reals y) { return VECTOR_LIBRARY(vv, f)(x, y); }
#else
#define UNARY(f)                                                                                                       \
    static inline reals each_##f(reals x)                                                                              \
    {                                                                                                                  \
        reals y;                                                                                                       \
        for (int lane = 0; lane < LANES; lane++)                                                                       \
            y[lane] = f(x[lane]);                                                                                      \
        return y;                                                                                                      \
    }
#define BINARY(f)                                                                                                      \
    static inline reals each_##f(reals x, reals y)                                                                     \
    {                                                                                                                  \
        reals z;                                                                                                       \
        for (int lane = 0; lane < LANES; lane++)                                                                       \
            z[lane] = f(x[lane], y[lane]);                                                                             \
        return z;                                                                                                      \
    }
#endif

UNARY(sin)
UNARY(cos)
UNARY(tan)
UNARY(asin)
UNARY(acos)
UNARY(atan)
UNARY(sinh)
UNARY(cosh)
UNARY(tanh)
UNARY(asinh)
UNARY(cbrt)
UNARY(exp)
UNARY(expm1)
UNARY(log)
UNARY(log1p)
BINARY(atan2)
BINARY(hypot)
BINARY(pow)

/* Computes LANES samples from the rows in[.] + at to the rows out[.] + at, which begin at whole vectors. */
static void group(const double *const *in, double *const *out, int64_t at);

/* The last samples, fewer than LANES, go through rows of their own, filled up with copies of the last one. */
static void last_group(const double *const *in, double *const *out, int64_t at, int count)
{
    double inputs[INPUTS][LANES];
    reals outputs[OUTPUTS];
    const double *from[INPUTS];
    double *to[OUTPUTS];
    for (int row = 0; row < INPUTS; row++) {
        for (int lane = 0; lane < LANES; lane++)
            inputs[row][lane] = in[row][at + (lane < count ? lane : count - 1)];
        from[row] = inputs[row];
    }
    for (int row = 0; row < OUTPUTS; row++)
        to[row] = (double *)&outputs[row];
    group(from, to, 0);
    finish();
    for (int row = 0; row < OUTPUTS; row++)
        memcpy(out[row] + at, &outputs[row], sizeof(double) * (size_t)count);
}

/* Numbers below 2.2e-308, of less than 53 bits, take some processors a hundred times longer: in this thread, and until
   it is done, they are zero, as operands and as results. */
#ifdef __SSE2__
#include <xmmintrin.h>
enum { SMALL_RESULTS_ARE_ZERO = 0x8000, SMALL_OPERANDS_ARE_ZERO = 0x0040 };
static inline unsigned without_subnormals(void)
{
    const unsigned mode = _mm_getcsr();
    _mm_setcsr(mode | SMALL_RESULTS_ARE_ZERO | SMALL_OPERANDS_ARE_ZERO);
    return mode;
}
static inline void restore(unsigned mode) { _mm_setcsr(mode); }
#else
static inline unsigned without_subnormals(void) { return 0; }
static inline void restore(unsigned mode) { (void)mode; }
#endif

void run(int64_t start, int64_t stop, const double *const *in, double *const *out)
{
    const unsigned mode = without_subnormals();
    int64_t at = start;
    for (; at + LANES <= stop; at += LANES)
        group(in, out, at);
    if (at < stop)
        last_group(in, out, at, (int)(stop - at));
    finish();
    restore(mode);
}
