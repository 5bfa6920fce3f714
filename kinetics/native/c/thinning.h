/* Candidates of a network in a crowd, and which of them are kept: the arithmetic of thinning.py, to the last bit. */

#ifndef WELLMIXED_THINNING_H
#define WELLMIXED_THINNING_H

#include "sampling.h"
#include "streams.h"

/* The sum of the propensities before the first channel that the crowd changes; `stride` from one row to the next. */
INLINE double uncrowded(const Thinning *thinning, const double *within, const double *upto, int64_t stride)
{
    const int64_t last = thinning->first - 1;
    if (last < 0)
        return 0.0;
    return within[last * stride] + (last >= BLOCK ? upto[(last / BLOCK - 1) * stride] : 0.0);
}

/* (f - low factor) / (low factor at s = 0) of channel k, one of those before merging. */
INLINE double share_kept(const Model *model, int64_t k, double surface, const double *copies, int64_t stride)
{
    const Thinning *thinning = model->thinning;
    const double *factors = thinning->factors + k * thinning->n_powers;
    double filled = 0.0, share = 0.0;
    for (int64_t s = 0; s < model->n_species; s++)
        filled += thinning->volumes[s] * copies[s * stride];
    const double per_free = 1.0 / (1.0 - filled), z = surface * per_free;
    for (int64_t d = thinning->n_powers - 1; d > 0; d--) /* Horner's rule */
        share = share * z + factors[d];
    return share * per_free + factors[0] - thinning->slopes[k] * surface;
}

/* The channel of a candidate that is kept, or n_channels for one that is not. `beyond` is how far a uniform share of
 * events and candidates lies beyond the events; what it has left over in its channel is itself uniform. */
INLINE int64_t kept_channel(const Model *model, const double *within, const double *copies, int64_t stride,
                            double beyond)
{
    const Thinning *thinning = model->thinning;
    double target = beyond, surface = 0.0;
    for (int64_t s = 0; s < model->n_species; s++)
        surface += thinning->weights[s] * copies[s * stride];
    for (int64_t g = thinning->first; g < model->n_channels; g++) {
        double part = within[g * stride];
        if (g % BLOCK > 0)
            part -= within[(g - 1) * stride];
        part *= thinning->ratio;
        if (target < part) {
            int64_t k = thinning->spans[g];
            const int64_t end = thinning->spans[g + 1];
            if (end - k == 1) {
                part *= 1.0 / thinning->ratio;
            } else { /* the channel that is thinned is one of those merged */
                const double own = copies[model->first[g] * stride];
                for (;;) {
                    part = thinning->coefficients[k] * own * (copies[thinning->partners[k] * stride] - thinning->less[k]);
                    const double whole = thinning->ratio * part * (1.0 + thinning->slopes[k] * surface);
                    if (target < whole)
                        break;
                    target -= whole;
                    if (++k == end)
                        return model->n_channels; /* by rounding */
                }
            }
            return target < part * share_kept(model, k, surface, copies, stride) ? g : model->n_channels;
        }
        target -= part;
    }
    return model->n_channels;
}

#endif
