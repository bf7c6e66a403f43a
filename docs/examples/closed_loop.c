/* The arm of robots/vsa_3r.yaml under its generated controller, one call a millisecond.

   In place of a real robot there is the generated plant. It starts 0.02 rad beside the command. */

#include "vsa_3r.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { N = VSA_3R_JOINTS };

static const double PERIOD = 1e-3;   /* s, of the controller */
static const double DURATION = 2.0;  /* s, of the motion; the reference rests afterwards */
static const double START[3] = {0, 0, 0}, END[3] = {1.5707963267948966, 0.7853981633974483, -1.0471975511965976};
static const double SOFT = 850, STIFF = 1275; /* N m/rad */

/* The stiffness of a spring of Table I at a deflection, to report that of the joints. */
static double spring_stiffness(double phi) { return 400 + 6000 * phi * phi; }

/* The reference */

/* A polynomial's value and derivatives with respect to time, x = t / DURATION held to 0..1. */
static void polynomial(const double *coefficients, int degree, double t, int orders, double *result)
{
    const double x = t < DURATION ? t / DURATION : 1;
    double c[10], scale = 1;
    memcpy(c, coefficients, sizeof(double) * (size_t)(degree + 1));
    for (int order = 0; order < orders; order++) {
        double value = 0;
        for (int power = degree - order; power >= 0; power--)
            value = value * x + c[power];
        result[order] = value * scale;
        for (int power = 0; power < degree - order; power++)
            c[power] = (power + 1) * c[power + 1];
        scale /= DURATION;
    }
}

/* From rest to rest; the fourth derivative of the position and the second of the stiffness are continuous. */
static void reference(double t, vsa_3r_command *command)
{
    static const double nine[10] = {0, 0, 0, 0, 0, 126, -420, 540, -315, 70}, five[6] = {0, 0, 0, 10, -15, 6};
    double s[5], r[3];
    polynomial(nine, 9, t, 5, s);
    polynomial(five, 5, t, 3, r);
    for (int j = 0; j < N; j++) {
        const double span = END[j] - START[j];
        command->q[j] = START[j] + span * s[0];
        command->dq[j] = span * s[1];
        command->ddq[j] = span * s[2];
        command->d3q[j] = span * s[3];
        command->d4q[j] = span * s[4];
        command->stiffness[j] = SOFT + (STIFF - SOFT) * r[0];
        command->dstiffness[j] = (STIFF - SOFT) * r[1];
        command->ddstiffness[j] = (STIFF - SOFT) * r[2];
    }
}

/* The controller */

static vsa_3r_gains four_poles_at(double pole)
{
    vsa_3r_gains gains = {.position_integral = {0}};
    for (int j = 0; j < N; j++) {
        const double p = -pole;
        gains.position[j][0] = p * p * p * p;
        gains.position[j][1] = 4 * p * p * p;
        gains.position[j][2] = 6 * p * p;
        gains.position[j][3] = 4 * p;
        gains.stiffness[j][0] = p * p;
        gains.stiffness[j][1] = 2 * p;
    }
    return gains;
}

/* Motors stand where the inverse dynamics of the reference's start wants them, shifted with the links. */
static unsigned start(vsa_3r_state *state, double error)
{
    vsa_3r_command command;
    vsa_3r_drive drive;
    reference(0, &command);
    const unsigned flags = vsa_3r_inverse_dynamics(&command, &drive);
    memset(state, 0, sizeof *state);
    for (int j = 0; j < N; j++) {
        state->q[j] = command.q[j] + error;
        for (int m = 0; m < 2; m++)
            state->theta[j][m] = drive.theta[j][m] + error;
    }
    return flags;
}

static void report(double t, const vsa_3r_state *state, const vsa_3r_command *command)
{
    double position = 0, stiffness = 0;
    for (int j = 0; j < N; j++) {
        const double q = state->q[j], *theta = state->theta[j];
        const double sigma = spring_stiffness(theta[0] - q) + spring_stiffness(theta[1] - q);
        position = fmax(position, fabs(q - command->q[j]));
        stiffness = fmax(stiffness, fabs(sigma - command->stiffness[j]));
    }
    printf("t = %.2f s: largest error %.5f rad, %.2f N m/rad\n", t, position, stiffness);
}

int main(void)
{
    const vsa_3r_gains gains = four_poles_at(-20);
    const vsa_3r_integral none = {.q = {0}};
    vsa_3r_state state; /* a real controller reads its encoders */
    if (start(&state, 0.02))
        return 2;
    for (long k = 0; k <= 2500; k++) {
        const double t = (double)k * PERIOD;
        vsa_3r_command command;
        vsa_3r_control control;
        vsa_3r_input input;
        reference(t, &command);
        if (k % 500 == 0)
            report(t, &state, &command);
        if (vsa_3r_feedback_linearization(&state, &command, &gains, &none, &control) & VSA_3R_SINGULAR) {
            printf("t = %.3f s: singular, stopping\n", t);
            return 3;
        }
        memcpy(input.tau_motor, control.tau_motor, sizeof input.tau_motor);
        if (vsa_3r_step(&state, &input, PERIOD, &state)) {
            printf("t = %.3f s: the plant has left its range, stopping\n", t);
            return 4;
        }
    }
    return 0;
}
