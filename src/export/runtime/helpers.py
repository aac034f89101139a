def _square(a):
    return a * a


def _node(value, low, high, nodes):
    """Number of the node below a value, and the way on to the next."""
    place = np.clip((value - low) / max(high - low, 1e-12) * (nodes - 1), 0.0, nodes - 1.0)
    k = np.minimum(place.astype(int), nodes - 2)
    return k, place - k


def _curve(b, n, value, low, high):
    k, t = _node(value, low, high, n)
    return b[k] * (1.0 - t) + b[k + 1] * t


def _ring(b, n, value, period):
    turn = value / period
    place = (turn - np.floor(turn)) * n
    k = place.astype(int)
    t = place - k
    return b[k % n] * (1.0 - t) + b[(k + 1) % n] * t


def _grid(b, n, across, first, low0, high0, down, second, low1, high1):
    i, s = _node(first, low0, high0, across)
    j, t = _node(second, low1, high1, down)

    def along(j):
        return b[j * across + i] * (1.0 - s) + b[j * across + i + 1] * s

    return along(j) * (1.0 - t) + along(j + 1) * t


def _cubic(at, last, nodes):
    """The first of the four cubic B-splines that are not zero, and their values (de Boor 1978)."""
    spans = nodes - 3
    place = np.clip(at / max(last, 1e-12) * spans, 0.0, float(spans))
    k = np.minimum(place.astype(int), spans - 1)
    t = place - k
    s = 1.0 - t

    def inner(a):
        return (3.0 * a * a * a - 6.0 * a * a + 4.0) / 6.0

    return k, (s * s * s / 6.0, inner(t), inner(s), t * t * t / 6.0)


def _spline(b, n, across, down, u, last_u, v, last_v):
    i, columns = _cubic(u, last_u, across)
    j, rows = _cubic(v, last_v, down)
    total = 0.0
    for row, w in enumerate(rows):
        first = (j + row) * across + i
        total = total + w * sum(b[first + k] * columns[k] for k in range(4))
    return total


def _powers(b, n, level, value, times):
    term, total = times * np.ones_like(value), 0.0
    for k in range(n):
        if level and k == 1:
            total = total + b[k] * times
            continue
        term = term * value
        total = total + b[k] * term
    return total


def _polynomial(b, n, first, second, times):
    powers = [(2, 0), (0, 2), (1, 1), (3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4)]
    return sum(c * times * first**i * second**j for c, (i, j) in zip(b, powers))


def _waves(b, n, stripes, value, period, times):
    phase = 2.0 * np.pi * (value / period)
    s, c = sin(phase), cos(phase)
    sk, ck, total = s, c, 0.0
    for k in range(n // 2):
        size = times * (0.2 / (k + 1) if stripes else 1.0)
        total = total + b[2 * k] * size * sk + b[2 * k + 1] * size * ck
        sk, ck = sk * c + ck * s, ck * c - sk * s
    return total
