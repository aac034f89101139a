/* The ray (x, y, 1) of a pixel, in single precision as kinoise keeps it. */
static inline void kinoise_ray(double u, double v, double *x, double *y)
{
    double xd = (u - kinoise_cx) / kinoise_fx, yd = (v - kinoise_cy) / kinoise_fy, a = xd, b = yd;
    const double *k = kinoise_distortion;
    int round;
    for (round = 0; kinoise_has_distortion && round < 100; round++) {
        double r2 = a * a + b * b, radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
        double dx = 2.0 * k[2] * a * b + k[3] * (r2 + 2.0 * a * a);
        double dy = k[2] * (r2 + 2.0 * b * b) + 2.0 * k[3] * a * b;
        double na = (xd - dx) / radial, nb = (yd - dy) / radial;
        double change = fmax(fabs(na - a), fabs(nb - b));
        a = na;
        b = nb;
        if (change < 1e-10)
            break;
    }
    *x = (float)a;
    *y = (float)b;
}

static inline kinoise_place kinoise_at(int i, const kinoise_conditions *known)
{
    kinoise_place p = {0};
    double right = KINOISE_WIDTH - 1.0 - kinoise_cx, below = KINOISE_HEIGHT - 1.0 - kinoise_cy;
    double far_u = fmax(fabs(kinoise_cx), fabs(right)), far_v = fmax(fabs(kinoise_cy), fabs(below));
    p.u = i % KINOISE_WIDTH;
    p.v = i / KINOISE_WIDTH;
    kinoise_ray(p.u, p.v, &p.x, &p.y);
    p.radius = hypot(p.u - kinoise_cx, p.v - kinoise_cy) / hypot(far_u, far_v);
    p.rho = p.variance = p.disparity = p.z = 1.0;
    p.session_s = known->session_s;
    p.temperature_c = known->has_temperature ? known->temperature_c : 0.0;
    p.ambient = known->has_ambient ? known->ambient_lux : kinoise_room_lux;
    return p;
}

/* On the plane of inverse depth qx x + qy y + qz. */
static inline void kinoise_lean(kinoise_place *p, double qx, double qy, double qz)
{
    p->slope_u = kinoise_scale_px_m * qx / kinoise_fx;
    p->slope_v = kinoise_scale_px_m * qy / kinoise_fy;
    p->rho = 1.0 / sqrt(qx * qx + qy * qy + qz * qz);
    p->theta = atan2(hypot(qx, qy), fabs(qz));
    p->azimuth = atan2(-qy, -qx);
}

/* A surface of this disparity before the pixel; slope is 0 where none is asked for. */
static inline void kinoise_stand(kinoise_place *p, double disparity, const float *slope)
{
    p->disparity = disparity;
    p->z = kinoise_scale_px_m / disparity;
    if (slope) {
        double qx = slope[0] * kinoise_fx / kinoise_scale_px_m, qy = slope[1] * kinoise_fy / kinoise_scale_px_m;
        kinoise_lean(p, qx, qy, disparity / kinoise_scale_px_m - qx * p->x - qy * p->y);
        p->slope_u = slope[0];
        p->slope_v = slope[1];
    }
}

static inline double kinoise_factor(double session_s)
{
    double factor = kinoise_scale;
    int k;
    for (k = 0; k < KINOISE_DRIFTS; k++)
        factor *= 1.0 - kinoise_drifts[2 * k] * expm1(-session_s / kinoise_drifts[2 * k + 1]);
    return factor;
}

static inline double kinoise_along_ray(const kinoise_place *p)
{
    double excess = sqrt(1.0 + p->x * p->x + p->y * p->y) - 1.0;
    return (float)(1.0 + kinoise_ray_share * excess);
}

static inline double kinoise_unlock(double d)
{
    double place = (d - floor(d)) * (KINOISE_UNLOCKING - 1), t;
    int k = place < KINOISE_UNLOCKING - 2 ? (int)place : KINOISE_UNLOCKING - 2;
    t = place - k;
    return d + kinoise_unlocking[k] * (1.0 - t) + kinoise_unlocking[k + 1] * t;
}

/* Disparity of a stored depth without the driver's errors and the pixel's own; NaN for none. */
static inline double kinoise_measured(int i, float z, double factor, const kinoise_conditions *known)
{
    kinoise_place p = kinoise_at(i, known);
    double d;
    if (!(z > 0.0f))
        return NAN;
    d = kinoise_scale_px_m * factor * kinoise_along_ray(&p) / z - (float)kinoise_still(p);
    return KINOISE_UNLOCKING > 1 ? kinoise_unlock(d) : d;
}

/* A plane in disparity over a window: how far its pixels lie off it, px^2, its middle and slope. */
typedef struct {
    int found;
    double variance, u, v, d, a, b;
} kinoise_plane;

static inline kinoise_plane kinoise_fit(const double *table, int u, int v, int left, int above)
{
    kinoise_plane p = {0};
    int u0 = u > left ? u - left : 0, v0 = v > above ? v - above : 0, k;
    int last_u = KINOISE_WIDTH > 13 ? KINOISE_WIDTH - 13 : 0, last_v = KINOISE_HEIGHT > 13 ? KINOISE_HEIGHT - 13 : 0;
    int u1, v1;
    double s[10], n, uu, uv, vv, ud, vd, dd, det, rest;
    u0 = u0 < last_u ? u0 : last_u;
    v0 = v0 < last_v ? v0 : last_v;
    u1 = u0 + 13 < KINOISE_WIDTH ? u0 + 13 : KINOISE_WIDTH;
    v1 = v0 + 13 < KINOISE_HEIGHT ? v0 + 13 : KINOISE_HEIGHT;
    for (k = 0; k < 10; k++) {
        const double *upper = table + 10 * v0 * (KINOISE_WIDTH + 1) + k;
        const double *lower = table + 10 * v1 * (KINOISE_WIDTH + 1) + k;
        s[k] = lower[10 * u1] - upper[10 * u1] - lower[10 * u0] + upper[10 * u0];
    }
    n = s[0];
    if (n < 56.0)
        return p;
    p.u = s[1] / n;
    p.v = s[2] / n;
    p.d = s[6] / n;
    uu = s[3] / n - p.u * p.u;
    uv = s[4] / n - p.u * p.v;
    vv = s[5] / n - p.v * p.v;
    ud = s[7] / n - p.u * p.d;
    vd = s[8] / n - p.v * p.d;
    dd = s[9] / n - p.d * p.d;
    det = uu * vv - uv * uv;
    if (det < uu + vv)
        return p;
    p.a = (vv * ud - uv * vd) / det;
    p.b = (uu * vd - uv * ud) / det;
    rest = dd - p.a * ud - p.b * vd;
    p.variance = (rest > 0.0 ? rest : 0.0) * n / (n - 3.0);
    p.found = 1;
    return p;
}

/* How the surface leans in disparity at a pixel, px per px (Crow 1984, Kuwahara 1976). */
static inline void kinoise_slope(const double *table, int u, int v, double d, float slope[2])
{
    kinoise_plane chosen = kinoise_fit(table, u, v, 6, 6), best = {0};
    int node = d < 255.0 ? (int)d : 255, corner, flat;
    double off;
    flat = chosen.found && chosen.variance <= kinoise_window_limits[node];
    for (corner = 0; corner < 4 && !flat; corner++) {
        kinoise_plane p = kinoise_fit(table, u, v, corner / 2 * 12, corner % 2 * 12);
        if (p.found && (!best.found || p.variance < best.variance))
            best = p;
    }
    if (best.found && (!chosen.found || chosen.variance > 3.0 * best.variance))
        chosen = best;
    off = d - chosen.d - chosen.a * (u - chosen.u) - chosen.b * (v - chosen.v);
    if (flat || (chosen.found && off * off <= 16.0 * fmax(chosen.variance, DBL_MIN))) {
        slope[0] = (float)chosen.a;
        slope[1] = (float)chosen.b;
    }
}

/* Slopes of all pixels from their disparities, two floats a pixel; 0 where memory is short. */
static inline float *kinoise_slopes(const double *d)
{
    size_t across = KINOISE_WIDTH + 1, u, v, k;
    double *table = (double *)calloc(10 * across * (KINOISE_HEIGHT + 1), sizeof *table);
    float *slopes = (float *)calloc(2 * (size_t)KINOISE_WIDTH * KINOISE_HEIGHT, sizeof *slopes);
    if (!table || !slopes) {
        free(table);
        free(slopes);
        return 0;
    }
    for (v = 0; v < KINOISE_HEIGHT; v++) {
        double sum[10] = {0};
        for (u = 0; u < KINOISE_WIDTH; u++) {
            double q = d[v * KINOISE_WIDTH + u], x = (double)u, y = (double)v;
            double *cell = table + 10 * ((v + 1) * across + u + 1);
            if (q > 0.0) {
                double moments[10] = {1.0, x, y, x * x, x * y, y * y, q, x * q, y * q, q * q};
                for (k = 0; k < 10; k++)
                    sum[k] += moments[k];
            }
            for (k = 0; k < 10; k++)
                cell[k] = sum[k];
        }
    }
    for (v = 2; v <= KINOISE_HEIGHT; v++)
        for (k = 0; k < 10 * across; k++)
            table[10 * v * across + k] += table[10 * (v - 1) * across + k];
    for (v = 0; v < KINOISE_HEIGHT; v++)
        for (u = 0; u < KINOISE_WIDTH; u++) {
            double q = d[v * KINOISE_WIDTH + u];
            if (q > 0.0)
                kinoise_slope(table, (int)u, (int)v, q, slopes + 2 * (v * KINOISE_WIDTH + u));
        }
    free(table);
    return slopes;
}

/* The disparity that the terms turn into the measured one, px. */
static inline double kinoise_solve(kinoise_place p, double measured, const float *slope, int temperature)
{
    double d = measured;
    int round;
    for (round = 0; round < 64 && KINOISE_BIAS_TERMS && measured > 0.0; round++) {
        double next, change;
        kinoise_stand(&p, d, slope);
        next = measured - kinoise_bias(p, temperature);
        if (!isfinite(next))
            return measured;
        change = fabs(next - d);
        d = next;
        if (!KINOISE_NEEDS_DEPTH || change < 1e-3 || d <= 0.0)
            break;
    }
    return d;
}

/* Disparities and slopes of an image; 0 where memory is short. */
static inline int kinoise_begin(const float *depth_m, const kinoise_conditions *known, int lean, double **d,
                                float **slopes)
{
    double factor = kinoise_factor(known->session_s);
    size_t i, pixels = (size_t)KINOISE_WIDTH * KINOISE_HEIGHT;
    *slopes = 0;
    *d = (double *)malloc(pixels * sizeof **d);
    if (!*d)
        return 0;
    for (i = 0; i < pixels; i++)
        (*d)[i] = kinoise_measured((int)i, depth_m[i], factor, known);
    if (lean && !(*slopes = kinoise_slopes(*d))) {
        free(*d);
        return 0;
    }
    return 1;
}

/* Depth without the sensor's biases, m; 0 and NaN stay, infinite where no disparity is left.
 * Returns 0, or -1 where memory is short. */
static inline int kinoise_correct(const float *depth_m, double *corrected_m, const kinoise_conditions *known)
{
    double *d;
    float *slopes;
    int i;
    if (!kinoise_begin(depth_m, known, KINOISE_NEEDS_SLOPE, &d, &slopes))
        return -1;
    for (i = 0; i < KINOISE_WIDTH * KINOISE_HEIGHT; i++) {
        corrected_m[i] = depth_m[i];
        if (depth_m[i] > 0.0f) {
            const float *slope = slopes ? slopes + 2 * i : 0;
            double q = kinoise_solve(kinoise_at(i, known), d[i], slope, known->has_temperature);
            corrected_m[i] = q > 0.0 ? kinoise_scale_px_m / q : INFINITY;
        }
    }
    free(d);
    free(slopes);
    return 0;
}

/* Standard deviation of each depth as stored, m; NaN where there is none. Returns as above. */
static inline int kinoise_sigma_image(const float *depth_m, double *sigma_m, const kinoise_conditions *known)
{
    double *d;
    float *slopes;
    int i;
    if (!kinoise_begin(depth_m, known, 1, &d, &slopes))
        return -1;
    for (i = 0; i < KINOISE_WIDTH * KINOISE_HEIGHT; i++) {
        kinoise_place p = kinoise_at(i, known);
        const float *slope = KINOISE_NEEDS_SLOPE ? slopes + 2 * i : 0;
        double q = depth_m[i] > 0.0f ? kinoise_solve(p, d[i], slope, known->has_temperature) : 0.0;
        sigma_m[i] = NAN;
        if (q > 0.0 && isfinite(q)) {
            double depth = kinoise_scale_px_m / q, plain;
            kinoise_stand(&p, kinoise_scale_px_m / depth, slopes + 2 * i);
            plain = kinoise_sigma(depth, p.theta);
            p.variance = kinoise_square(plain * p.disparity / depth);
            sigma_m[i] = plain * exp(0.5 * kinoise_log_variance(p, known->has_temperature));
        }
    }
    free(d);
    free(slopes);
    return 0;
}

/* Through the raw value: rounded, and NaN where none stands for it. */
static inline double kinoise_stored(double z)
{
    double exact = KINOISE_RAW_DISPARITY ? (1.0 / z - kinoise_raw_offset) / kinoise_raw_slope : z * kinoise_units_per_metre;
    double raw = floor(exact + 0.5);
    double back = KINOISE_RAW_DISPARITY ? 1.0 / (kinoise_raw_offset + kinoise_raw_slope * raw) : raw / kinoise_units_per_metre;
    int good = z > 0.0 && raw > 0.0 && raw < kinoise_raw_end && raw != kinoise_invalid && back > 0.0 && back < 100.0;
    return good ? back : NAN;
}

/* What the sensor stores at pixel i of a true depth, m, on a surface with this unit normal; noise is
 * a standard normal number. NaN where it stores nothing. */
static inline double kinoise_sample(int i, double depth_m, const double normal[3], double noise,
                                    const kinoise_conditions *known)
{
    kinoise_place p = kinoise_at(i, known);
    double level, step, rounding, variance, measured, d;
    if (!(depth_m > 0.0))
        return NAN;
    p.z = depth_m;
    p.disparity = kinoise_scale_px_m / depth_m;
    level = (normal[0] * p.x + normal[1] * p.y + normal[2]) * depth_m;
    kinoise_lean(&p, normal[0] / level, normal[1] / level, normal[2] / level);
    step = KINOISE_RAW_DISPARITY ? fabs(kinoise_raw_slope) * depth_m * depth_m : 1.0 / kinoise_units_per_metre;
    rounding = step * step / 12.0;
    variance = fmax(kinoise_square(kinoise_sigma(depth_m, p.theta)) - rounding, 0.0);
    p.variance = (variance + rounding) * kinoise_square(kinoise_scale_px_m / (depth_m * depth_m));
    if (KINOISE_VARIANCE_TERMS) {
        double ratio = exp(kinoise_log_variance(p, known->has_temperature));
        variance = fmax((variance + rounding) * ratio - rounding, 0.0);
    }
    measured = depth_m + sqrt(variance) * noise;
    if (!(measured > 0.0))
        return NAN;
    d = kinoise_scale_px_m / measured + kinoise_bias(p, known->has_temperature);
    d += (float)kinoise_still(p) - kinoise_locking_px * sin(6.283185307179586 * d);
    if (!(d > 0.0))
        return NAN;
    return kinoise_stored(kinoise_scale_px_m / d * kinoise_along_ray(&p) * kinoise_factor(known->session_s));
}
