/* The operations of generated code in JavaScript, as drlsl.logic.core.NODES defines them; each is total, and NaN where it is undefined. */

function op_whole(value) {
  return Math.abs(value) < 9007199254740992 ? value : NaN;
}

function op_abs(value) {
  return Math.abs(value);
}

function op_min(left, right) {
  return left < right ? left : right;
}

function op_max(left, right) {
  return left >= right ? left : right;
}

function op_div(left, right) {
  return right !== 0 ? left / right : NaN;
}

function op_sqrt(value) {
  return value >= 0 ? Math.sqrt(value) : NaN;
}

function op_sign(value) {
  return value > 0 ? 1 : value < 0 ? -1 : value;
}

function op_isign(value) {
  return op_sign(value);
}

function op_floor(value) {
  return Math.floor(value);
}

function op_ceiling(value) {
  return Math.ceil(value);
}

function op_truncate(value) {
  return value < 0 ? Math.ceil(value) : Math.floor(value);
}

function op_round(value) {
  const whole = op_truncate(value);
  const rest = value - whole;
  return whole + (rest >= 0.5 ? 1 : 0) - (rest <= -0.5 ? 1 : 0);
}

function op_truncdiv(left, right) {
  return right !== 0 ? (left - left % right) / right : NaN;
}

function op_mod(left, right) {
  const rest = right !== 0 ? left % right : NaN;
  return rest !== 0 && (rest < 0) !== (right < 0) ? rest + right : rest;
}

function op_floordiv(left, right) {
  return op_round((left - op_mod(left, right)) / (right !== 0 ? right : NaN));
}

function op_bits(value) {
  return Number.isSafeInteger(value) ? BigInt(value) : 0n;
}

function op_bitand(left, right) {
  return Number(op_bits(left) & op_bits(right));
}

function op_bitor(left, right) {
  return Number(op_bits(left) | op_bits(right));
}

function op_bitxor(left, right) {
  return Number(op_bits(left) ^ op_bits(right));
}

function op_shift_left(value, places) {
  const most = places < 0 ? -places : places;
  let result = value;
  for (let step = 0; step < 60 && step < most; step += 1) {
    result = places < 0 ? Math.floor(result / 2) : result * 2;
  }
  return places > 60 && value !== 0 ? NaN : op_whole(result);
}

function op_shift_right(value, places) {
  return op_shift_left(value, -places);
}

function op_gcd(left, right) {
  let one = Math.abs(left);
  let other = Math.abs(right);
  for (let step = 0; step < 100 && other > 0; step += 1) {
    const rest = one % other;
    one = other;
    other = rest;
  }
  return one;
}

function op_lcm(left, right) {
  const divisor = op_gcd(left, right);
  return divisor > 0 ? op_whole(Math.abs(left) / divisor * Math.abs(right)) : divisor;
}

function op_msb(value) {
  let rest = value;
  let place = 0;
  for (let step = 0; step < 53 && rest >= 2; step += 1) {
    rest = Math.floor(rest / 2);
    place = place + 1;
  }
  return value >= 1 ? place : NaN;
}

function op_popcount(value) {
  let rest = Math.abs(value);
  let count = 0;
  for (let step = 0; step < 53; step += 1) {
    count = count + rest % 2;
    rest = Math.floor(rest / 2);
  }
  return count;
}

function op_getbit(value, place) {
  return place >= 0 ? op_mod(op_shift_right(value, place), 2) : NaN;
}

function op_exp(value) {
  return Math.exp(value);
}

function op_log(value) {
  return value > 0 ? Math.log(value) : NaN;
}

function op_pow(base, exponent) {
  return Math.pow(base, exponent);
}

function op_sin(value) {
  return Math.sin(value);
}

function op_cos(value) {
  return Math.cos(value);
}

function op_tan(value) {
  return Math.tan(value);
}

function op_asin(value) {
  return Math.asin(value);
}

function op_acos(value) {
  return Math.acos(value);
}

function op_atan(value) {
  return Math.atan(value);
}

function op_sinh(value) {
  return Math.sinh(value);
}

function op_cosh(value) {
  return Math.cosh(value);
}

function op_tanh(value) {
  return Math.tanh(value);
}

function op_asinh(value) {
  return Math.asinh(value);
}

function op_acosh(value) {
  return Math.acosh(value);
}

function op_atanh(value) {
  return Math.atanh(value);
}
