/* What is known of a pixel and of what it looks at: px, m, rad, s. */
typedef struct {
    double u, v, x, y, radius, disparity, z, rho, slope_u, slope_v, theta, azimuth, variance;
    double session_s, temperature_c, ambient;
} kinoise_place;

/* What is known of a frame; {0} where nothing is: a lit room. */
typedef struct {
    double session_s;
    int has_temperature;
    double temperature_c;
    int has_ambient;
    double ambient_lux;
} kinoise_conditions;

/* The place, or that with the last disparity at which a shape was learnt. */
static inline kinoise_place kinoise_hold(kinoise_place p, double low, double high)
{
    p.disparity = kinoise_clamp(p.disparity, low, high);
    return p;
}
