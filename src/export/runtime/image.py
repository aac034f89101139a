def _rays():
    """The ray (x, y, 1) of every pixel, in single precision as kinoise keeps it."""
    v, u = np.divmod(np.arange(WIDTH * HEIGHT), WIDTH)
    xd, yd = (u - _cx) / _fx, (v - _cy) / _fy
    if _distortion is not None:
        k1, k2, p1, p2, k3 = _distortion
        x, y = xd.copy(), yd.copy()
        moving = np.ones(len(x), bool)
        for _ in range(100):
            a, b = x[moving], y[moving]
            r2 = a * a + b * b
            radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
            dx = 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a)
            dy = p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b
            x[moving], y[moving] = (xd[moving] - dx) / radial, (yd[moving] - dy) / radial
            change = np.maximum(np.abs(x[moving] - a), np.abs(y[moving] - b))
            moving[np.flatnonzero(moving)[change < 1e-10]] = False
            if not moving.any():
                break
        xd, yd = x, y
    single = [a.astype(np.float32).astype(float) for a in (xd, yd)]
    return u.astype(float), v.astype(float), *single


_u, _v, _x, _y = _rays()
_radius = np.hypot(_u - _cx, _v - _cy) / max(
    np.hypot(u - _cx, v - _cy) for u in (0.0, WIDTH - 1.0) for v in (0.0, HEIGHT - 1.0)
)


def _place(pixels, session_s, temperature_c, ambient_lux):
    one = np.ones(len(pixels))
    return SimpleNamespace(
        u=_u[pixels], v=_v[pixels], x=_x[pixels], y=_y[pixels], radius=_radius[pixels],
        rho=one, variance=one, disparity=one, z=one, slope_u=0 * one, slope_v=0 * one,
        theta=0 * one, azimuth=0 * one, session_s=session_s * one,
        temperature_c=(0.0 if temperature_c is None else temperature_c) * one, ambient=ambient_lux * one,
    )


def _lean(p, qx, qy, qz):
    """On the plane of inverse depth qx x + qy y + qz."""
    p.slope_u, p.slope_v = _scale_px_m * qx / _fx, _scale_px_m * qy / _fy
    p.rho = 1.0 / sqrt(qx * qx + qy * qy + qz * qz)
    p.theta = np.arctan2(np.hypot(qx, qy), np.abs(qz))
    p.azimuth = np.arctan2(-qy, -qx)


def _hold(p, low, high):
    """The place, or that with the last disparity at which a shape was learnt."""
    held = SimpleNamespace(**vars(p))
    held.disparity = np.clip(p.disparity, low, high)
    return held


def _sum(terms, p, temperature_c):
    total = np.zeros(len(p.u))
    for term, asks_temperature in terms:
        if temperature_c is not None or not asks_temperature:
            total = total + term(p)
    return total


_still = _sum(_still_terms, _place(np.arange(WIDTH * HEIGHT), 0.0, None, 0.0), None).astype(np.float32).astype(float)


def _unlock(d):
    place = (d - np.floor(d)) * (len(_unlocking) - 1)
    k = np.minimum(place.astype(int), len(_unlocking) - 2)
    t = place - k
    return d + _unlocking[k] * (1.0 - t) + _unlocking[k + 1] * t


def _factor(session_s):
    factor = _scale
    for relative, time_constant_s in _drifts:
        factor *= 1.0 - relative * np.expm1(-session_s / time_constant_s)
    return factor


def _along_ray():
    excess = sqrt(1.0 + _x * _x + _y * _y) - 1.0
    return (1.0 + _ray_share * excess).astype(np.float32).astype(float)


def _windows(d):
    """Summed-area tables of the measured pixels' moments."""
    d = d.reshape(HEIGHT, WIDTH)
    seen = d > 0.0
    d = np.where(seen, d, 0.0)
    x, y = np.where(seen, _u.reshape(d.shape), 0.0), np.where(seen, _v.reshape(d.shape), 0.0)
    moments = [seen.astype(float), x, y, x * x, x * y, y * y, d, x * d, y * d, d * d]
    return [np.pad(np.cumsum(np.cumsum(m, axis=1), axis=0), ((1, 0), (1, 0))) for m in moments]


def _fit(tables, u, v, left, above):
    """Planes in disparity over windows of 13 x 13 px; a variance of infinity where there is none."""
    u0 = np.minimum(np.maximum(u - left, 0), max(WIDTH - 13, 0))
    v0 = np.minimum(np.maximum(v - above, 0), max(HEIGHT - 13, 0))
    u1, v1 = np.minimum(u0 + 13, WIDTH), np.minimum(v0 + 13, HEIGHT)
    s = [t[v1, u1] - t[v0, u1] - t[v1, u0] + t[v0, u0] for t in tables]
    n = s[0]
    with np.errstate(all="ignore"):
        mu, mv, md = s[1] / n, s[2] / n, s[6] / n
        uu, uv, vv = s[3] / n - mu * mu, s[4] / n - mu * mv, s[5] / n - mv * mv
        ud, vd, dd = s[7] / n - mu * md, s[8] / n - mv * md, s[9] / n - md * md
        det = uu * vv - uv * uv
        a, b = (vv * ud - uv * vd) / det, (uu * vd - uv * ud) / det
        variance = fmax(dd - a * ud - b * vd, 0.0) * n / (n - 3.0)
        good = (n >= 56.0) & (det >= uu + vv)
    return [np.where(good, q, e) for q, e in zip((variance, mu, mv, md, a, b), (np.inf, 0, 0, 0, 0, 0))]


def _slopes(d, pixels):
    """How the surface leans in disparity at each pixel, px per px (Crow 1984, Kuwahara 1976)."""
    tables = _windows(d)
    u, v, d = _u[pixels].astype(int), _v[pixels].astype(int), d[pixels]
    middle = _fit(tables, u, v, 6, 6)
    corners = np.array([_fit(tables, u, v, left, above) for left in (0, 12) for above in (0, 12)])
    first = np.argmin(corners[:, 0], axis=0)
    best = [corners[first, k, np.arange(len(u))] for k in range(6)]
    node = np.clip(d, 0, len(_window_limits) - 1).astype(int)
    flat = np.isfinite(middle[0]) & (middle[0] <= _window_limits[node])
    with np.errstate(invalid="ignore"):
        corner = ~np.isfinite(middle[0]) | (np.isfinite(best[0]) & (middle[0] > 3.0 * best[0]))
        variance, mu, mv, md, a, b = (np.where(~flat & corner, q, m) for q, m in zip(best, middle))
        off = d - md - a * (u - mu) - b * (v - mv)
        on_it = np.isfinite(variance) & (off * off <= 16.0 * fmax(variance, np.finfo(float).tiny))
    use = (flat | on_it) & (d > 0.0)
    return [np.where(use, q, 0.0).astype(np.float32).astype(float) for q in (a, b)]


def _stand(p, disparity, slopes):
    """A surface of this disparity before each pixel, leaning as the picture shows."""
    p.disparity, p.z = disparity, _scale_px_m / disparity
    if slopes is not None:
        qx, qy = slopes[0] * _fx / _scale_px_m, slopes[1] * _fy / _scale_px_m
        _lean(p, qx, qy, disparity / _scale_px_m - qx * p.x - qy * p.y)
        p.slope_u, p.slope_v = slopes


def _measured(depth_m, session_s):
    """Disparity of every pixel without the driver's errors and the pixel's own; NaN for none."""
    z = np.asarray(depth_m, np.float32).astype(float).reshape(-1)
    if len(z) != WIDTH * HEIGHT:
        raise ValueError(f"{len(z)} depths for {WIDTH} x {HEIGHT} pixels")
    d = np.full(len(z), np.nan)
    seen = z > 0.0
    along = _along_ray() if _ray_share else np.ones(len(z))
    d[seen] = (_scale_px_m * _factor(session_s) * along / np.where(seen, z, 1.0) - _still)[seen]
    if len(_unlocking):
        d[seen] = _unlock(d[seen])
    return z, d, np.flatnonzero(seen)


def _solve(p, measured, slopes, temperature_c):
    """The disparity that the terms turn into the measured one, px."""
    d, going = measured.copy(), measured > 0.0
    if not _bias_terms:
        return d
    for _ in range(64):
        now = np.flatnonzero(going)
        if not len(now):
            break
        q = SimpleNamespace(**{name: a[now] for name, a in vars(p).items()})
        _stand(q, d[now], None if slopes is None else [s[now] for s in slopes])
        step = measured[now] - _sum(_bias_terms, q, temperature_c)
        lost = ~np.isfinite(step)
        change = np.abs(step - d[now])
        d[now] = np.where(lost, measured[now], step)
        going[now[lost | (not _needs_depth) | (change < 1e-3) | (d[now] <= 0.0)]] = False
    return d


def correct(depth_m, session_s=0.0, temperature_c=None, ambient_lux=500.0):
    """Depth without the sensor's biases, m. NaN and 0 stay; infinite where no disparity is left."""
    shape = np.shape(depth_m)
    z, d, pixels = _measured(depth_m, session_s)
    slopes = _slopes(d, pixels) if _needs_slope else None
    p = _place(pixels, session_s, temperature_c, ambient_lux)
    with np.errstate(all="ignore"):
        d = _solve(p, d[pixels], slopes, temperature_c)
        z[pixels] = np.where(d > 0.0, _scale_px_m / d, np.inf)
    return z.reshape(shape)


def sigma_image(depth_m, session_s=0.0, temperature_c=None, ambient_lux=500.0):
    """Standard deviation of each depth as stored, m: sigma at the corrected depth and the surface's
    tilt, times what the model says of the pixel's noise beyond it. NaN where there is no depth."""
    shape = np.shape(depth_m)
    z, d, pixels = _measured(depth_m, session_s)
    slopes = _slopes(d, pixels)
    p = _place(pixels, session_s, temperature_c, ambient_lux)
    with np.errstate(all="ignore"):
        d = _solve(p, d[pixels], slopes if _needs_slope else None, temperature_c)
        good = (d > 0.0) & np.isfinite(d)
        depth = _scale_px_m / np.where(good, d, 1.0)
        _stand(p, _scale_px_m / depth, slopes)
        plain = sigma(depth, p.theta)
        p.variance = _square(plain * p.disparity / depth)
        found = plain * exp(0.5 * _sum(_variance_terms, p, temperature_c))
    out = np.full(len(z), np.nan)
    out[pixels] = np.where(good, found, np.nan)
    return out.reshape(shape)


def _step_inverse(z):
    if _raw_disparity is not None:
        return np.abs(_raw_disparity[1]) * np.ones_like(z)
    return 1.0 / (_units_per_metre * z * z)


def _stored(z):
    """Through the raw value: rounded, and NaN where none stands for it."""
    with np.errstate(all="ignore"):
        if _raw_disparity is not None:
            exact = (1.0 / z - _raw_disparity[0]) / _raw_disparity[1]
        else:
            exact = z * _units_per_metre
        raw = np.floor(exact + 0.5)
        if _raw_disparity is not None:
            back = 1.0 / (_raw_disparity[0] + _raw_disparity[1] * raw)
        else:
            back = raw / _units_per_metre
        good = (z > 0.0) & (raw > 0.0) & (raw < _raw_end) & (raw != _invalid) & (back > 0.0) & (back < 100.0)
    return np.where(good, back, np.nan)


def sample(depth_m, normals=None, noise=None, rng=None, session_s=0.0, temperature_c=None, ambient_lux=500.0):
    """What the sensor stores of a true depth image, m: its noise, its biases, its rounding.

    normals: unit normals (height, width, 3) of the surfaces; without them they are taken from the
    depth. noise: standard normal numbers; without them they are drawn from rng."""
    shape = np.shape(depth_m)
    true = np.asarray(depth_m, float).reshape(-1)
    if len(true) != WIDTH * HEIGHT:
        raise ValueError(f"{len(true)} depths for {WIDTH} x {HEIGHT} pixels")
    if noise is None:
        noise = (rng or np.random.default_rng()).standard_normal(len(true))
    pixels = np.flatnonzero(true > 0.0)
    z, n = true[pixels], np.asarray(noise, float).reshape(-1)[pixels]
    p = _place(pixels, session_s, temperature_c, ambient_lux)
    d = np.full(len(true), np.nan)
    d[pixels] = _scale_px_m / z
    if normals is None:
        _stand(p, d[pixels], _slopes(d, pixels))
    else:
        p.disparity, p.z = d[pixels], z
        a, b, c = np.asarray(normals, float).reshape(-1, 3)[pixels].T
        level = (a * p.x + b * p.y + c) * z
        _lean(p, a / level, b / level, c / level)
    with np.errstate(all="ignore"):
        rounding = _square(_step_inverse(z) * z * z) / 12.0
        plain = fmax(_square(sigma(z, p.theta)) - rounding, 0.0)
        p.variance = (plain + rounding) * _square(_scale_px_m / (z * z))
        ratio = exp(_sum(_variance_terms, p, temperature_c))
        if _variance_terms:
            plain = fmax((plain + rounding) * ratio - rounding, 0.0)
        measured = z + sqrt(plain) * n
        found = np.where(measured > 0.0, _scale_px_m / measured, np.nan)
        found = found + _sum(_bias_terms, p, temperature_c)
        found = found - _locking_px * sin(2.0 * np.pi * found) + _still[pixels]
        found = np.where(found > 0.0, _scale_px_m / found, np.nan)
        if _ray_share:
            found = found * _along_ray()[pixels]
        found = found * _factor(session_s)
    out = np.full(len(true), np.nan)
    out[pixels] = _stored(found)
    return out.reshape(shape)
