/* The operations of generated code in C, as drlsl.logic.core.NODES defines them; each is total, and NaN where it is undefined. */

static double op_whole(double value)
{
    return fabs(value) < 9007199254740992.0 ? value : NAN;
}

static double op_abs(double value)
{
    return fabs(value);
}

static double op_min(double left, double right)
{
    return left < right ? left : right;
}

static double op_max(double left, double right)
{
    return left >= right ? left : right;
}

static double op_div(double left, double right)
{
    return right != 0.0 ? left / right : NAN;
}

static double op_sqrt(double value)
{
    return value >= 0.0 ? sqrt(value) : NAN;
}

static double op_sign(double value)
{
    return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : value;
}

static double op_isign(double value)
{
    return op_sign(value);
}

static double op_floor(double value)
{
    return floor(value);
}

static double op_ceiling(double value)
{
    return ceil(value);
}

static double op_truncate(double value)
{
    return value < 0.0 ? ceil(value) : floor(value);
}

static double op_round(double value)
{
    const double whole = op_truncate(value);
    const double rest = value - whole;
    return whole + (rest >= 0.5 ? 1.0 : 0.0) - (rest <= -0.5 ? 1.0 : 0.0);
}

static double op_truncdiv(double left, double right)
{
    return right != 0.0 ? (left - fmod(left, right)) / right : NAN;
}

static double op_mod(double left, double right)
{
    const double rest = right != 0.0 ? fmod(left, right) : NAN;
    return rest != 0.0 && (rest < 0.0) != (right < 0.0) ? rest + right : rest;
}

static double op_floordiv(double left, double right)
{
    return op_round((left - op_mod(left, right)) / (right != 0.0 ? right : NAN));
}

static int64_t op_bits(double value)
{
    return fabs(value) < 9007199254740992.0 ? (int64_t)value : 0;
}

static double op_bitand(double left, double right)
{
    return (double)(op_bits(left) & op_bits(right));
}

static double op_bitor(double left, double right)
{
    return (double)(op_bits(left) | op_bits(right));
}

static double op_bitxor(double left, double right)
{
    return (double)(op_bits(left) ^ op_bits(right));
}

static double op_shift_left(double value, double places)
{
    const double most = places < 0.0 ? -places : places;
    double result = value;
    for (int32_t step = 0; step < 60 && step < most; step += 1) {
        result = places < 0.0 ? floor(result / 2.0) : result * 2.0;
    }
    return places > 60.0 && value != 0.0 ? NAN : op_whole(result);
}

static double op_shift_right(double value, double places)
{
    return op_shift_left(value, -places);
}

static double op_gcd(double left, double right)
{
    double one = fabs(left);
    double other = fabs(right);
    for (int32_t step = 0; step < 100 && other > 0.0; step += 1) {
        const double rest = fmod(one, other);
        one = other;
        other = rest;
    }
    return one;
}

static double op_lcm(double left, double right)
{
    const double divisor = op_gcd(left, right);
    return divisor > 0.0 ? op_whole(fabs(left) / divisor * fabs(right)) : divisor;
}

static double op_msb(double value)
{
    double rest = value;
    double place = 0.0;
    for (int32_t step = 0; step < 53 && rest >= 2.0; step += 1) {
        rest = floor(rest / 2.0);
        place = place + 1.0;
    }
    return value >= 1.0 ? place : NAN;
}

static double op_popcount(double value)
{
    double rest = fabs(value);
    double count = 0.0;
    for (int32_t step = 0; step < 53; step += 1) {
        count = count + fmod(rest, 2.0);
        rest = floor(rest / 2.0);
    }
    return count;
}

static double op_getbit(double value, double place)
{
    return place >= 0.0 ? op_mod(op_shift_right(value, place), 2.0) : NAN;
}

static double op_exp(double value)
{
    return exp(value);
}

static double op_log(double value)
{
    return value > 0.0 ? log(value) : NAN;
}

static double op_pow(double base, double exponent)
{
    return pow(base, exponent);
}

static double op_sin(double value)
{
    return sin(value);
}

static double op_cos(double value)
{
    return cos(value);
}

static double op_tan(double value)
{
    return tan(value);
}

static double op_asin(double value)
{
    return asin(value);
}

static double op_acos(double value)
{
    return acos(value);
}

static double op_atan(double value)
{
    return atan(value);
}

static double op_sinh(double value)
{
    return sinh(value);
}

static double op_cosh(double value)
{
    return cosh(value);
}

static double op_tanh(double value)
{
    return tanh(value);
}

static double op_asinh(double value)
{
    return asinh(value);
}

static double op_acosh(double value)
{
    return acosh(value);
}

static double op_atanh(double value)
{
    return atanh(value);
}

static double op_erf(double value)
{
    return erf(value);
}

static double op_erfc(double value)
{
    return erfc(value);
}

static double op_lgamma(double value)
{
    return lgamma(value);
}
