static inline double kinoise_square(double a) { return a * a; }

static inline double kinoise_clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

/* Number of the node below a value, and the way on to the next. */
static inline int kinoise_node(double value, double low, double high, int nodes, double *way)
{
    double width = high - low > 1e-12 ? high - low : 1e-12;
    double place = kinoise_clamp((value - low) / width * (nodes - 1), 0.0, nodes - 1.0);
    int k = place < nodes - 2 ? (int)place : nodes - 2;
    *way = place - k;
    return k;
}

static inline double kinoise_curve(const double *b, int n, double value, double low, double high)
{
    double t;
    int k = kinoise_node(value, low, high, n, &t);
    return b[k] * (1.0 - t) + b[k + 1] * t;
}

static inline double kinoise_ring(const double *b, int n, double value, double period)
{
    double turn = value / period, place = (turn - floor(turn)) * n;
    int k = (int)place;
    double t = place - k;
    return b[k % n] * (1.0 - t) + b[(k + 1) % n] * t;
}

static inline double kinoise_grid(const double *b, int n, int across, double first, double low0, double high0,
                                  int down, double second, double low1, double high1)
{
    double s, t;
    int i = kinoise_node(first, low0, high0, across, &s), j = kinoise_node(second, low1, high1, down, &t);
    const double *near = b + j * across + i, *far = near + across;
    (void)n;
    return (near[0] * (1.0 - s) + near[1] * s) * (1.0 - t) + (far[0] * (1.0 - s) + far[1] * s) * t;
}

/* The first of the four cubic B-splines that are not zero, and their values (de Boor 1978). */
static inline int kinoise_cubic(double at, double last, int nodes, double w[4])
{
    int spans = nodes - 3;
    double place = kinoise_clamp(at / (last > 1e-12 ? last : 1e-12) * spans, 0.0, spans);
    int k = place < spans - 1 ? (int)place : spans - 1;
    double t = place - k, s = 1.0 - t;
    w[0] = s * s * s / 6.0;
    w[1] = (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0;
    w[2] = (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0;
    w[3] = t * t * t / 6.0;
    return k;
}

static inline double kinoise_spline(const double *b, int n, int across, int down, double u, double last_u,
                                    double v, double last_v)
{
    double columns[4], rows[4], total = 0.0;
    int i = kinoise_cubic(u, last_u, across, columns), j = kinoise_cubic(v, last_v, down, rows), row, k;
    (void)n;
    for (row = 0; row < 4; row++) {
        double along = 0.0;
        for (k = 0; k < 4; k++)
            along += b[(j + row) * across + i + k] * columns[k];
        total += rows[row] * along;
    }
    return total;
}

static inline double kinoise_powers(const double *b, int n, int level, double value, double times)
{
    double term = times, total = 0.0;
    int k;
    for (k = 0; k < n; k++) {
        if (level && k == 1) {
            total += b[k] * times;
            continue;
        }
        term *= value;
        total += b[k] * term;
    }
    return total;
}

static inline double kinoise_polynomial(const double *b, int n, double first, double second, double times)
{
    static const int powers[12][2] = {{2, 0}, {0, 2}, {1, 1}, {3, 0}, {2, 1}, {1, 2},
                                      {0, 3}, {4, 0}, {3, 1}, {2, 2}, {1, 3}, {0, 4}};
    double total = 0.0;
    int k;
    for (k = 0; k < n; k++)
        total += b[k] * times * pow(first, powers[k][0]) * pow(second, powers[k][1]);
    return total;
}

static inline double kinoise_waves(const double *b, int n, int stripes, double value, double period, double times)
{
    double phase = 6.283185307179586 * (value / period), s = sin(phase), c = cos(phase);
    double sk = s, ck = c, total = 0.0;
    int k;
    for (k = 0; k < n / 2; k++) {
        double size = times * (stripes ? 0.2 / (k + 1) : 1.0), next = sk * c + ck * s;
        total += b[2 * k] * size * sk + b[2 * k + 1] * size * ck;
        ck = ck * c - sk * s;
        sk = next;
    }
    return total;
}
