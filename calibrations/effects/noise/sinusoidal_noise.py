from calibrations.effects import Effect, Parameter, Values

MOST = 4


def _amplitude(k: int) -> Parameter:
    return Parameter("{out}", typical=1e-4, low=0.0, doc=f"a of line {k}")


def _frequency(k: int) -> Parameter:
    return Parameter("Hz", typical=1.0, low=0.0, doc=f"f of line {k}")


class SinusoidalNoise(Effect):
    """sinusoidal-noise: hum or another periodic signal: up to four sinusoids, the strongest first.

        V += sum_k a_k sin(2 pi f_k t + phase)      a in {out}, f in Hz
        Allan deviation a sin^2(pi f tau) / (pi f tau)

    Symptom   the spectrum has lines; the Allan deviation oscillates, and may hide a line at octaves of its period.
    Excited by  a still record of six periods or more, with two samples or more in each; else it appears at another
              frequency.
    Confused with  gauss-markov-noise, if frequency or amplitude change.
    Source    Book 17.3: sinusoidal noise; IEEE Std 952, annex C; Rife and Boorstyn, IEEE Trans. Inf. Theory 20 (1974).
    """

    kinds = ("still",)

    amplitude_1 = _amplitude(1)
    frequency_1 = _frequency(1)
    amplitude_2 = _amplitude(2)
    frequency_2 = _frequency(2)
    amplitude_3 = _amplitude(3)
    frequency_3 = _frequency(3)
    amplitude_4 = _amplitude(4)
    frequency_4 = _frequency(4)

    def lines(self, p: Values) -> tuple[tuple[float, float], ...]:
        members = [(f"frequency_{k}", f"amplitude_{k}") for k in range(1, MOST + 1)]
        return tuple((float(p[f]), float(p[a])) for f, a in members if a in p and p[a] > 0)
