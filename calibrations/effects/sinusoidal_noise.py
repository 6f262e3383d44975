"""sinusoidal-noise: hum, or whatever else repeats itself: up to four sinusoids, the strongest first.

    V += sum_k a_k sin(2 pi f_k t + phase)      a in {out}, f in Hz
    Allan deviation a sin^2(pi f tau) / (pi f tau)

Symptom   lines in the spectrum; the Allan deviation goes up and down, and may hide it at octaves of the period.
Excited by  a still record of six periods or more, sampled twice or more in each: else it shows at another frequency.
Confused with  gauss-markov-noise where frequency or amplitude wander.
Source    Book 17.3: sinusoidal noise; IEEE Std 952, annex C; Rife and Boorstyn, IEEE Trans. Inf. Theory 20 (1974).
"""

from calibrations.effect import Parameter, Values

KINDS = ("still",)
MOST = 4
PARAMETERS = tuple(
    parameter
    for k in range(1, MOST + 1)
    for parameter in (
        Parameter(f"amplitude_{k}", "{out}", typical=1e-4, low=0.0, doc=f"a of line {k}"),
        Parameter(f"frequency_{k}", "Hz", typical=1.0, low=0.0, doc=f"f of line {k}"),
    )
)


def lines(p: Values) -> tuple[tuple[float, float], ...]:
    named = [(f"frequency_{k}", f"amplitude_{k}") for k in range(1, MOST + 1)]
    return tuple((float(p[f]), float(p[a])) for f, a in named if a in p and p[a] > 0)
