// Points of the object that meet: opposite impulses on pairs within the distance that come closer, each point
// taking its share of those that it is in. A list of pairs serves until points have moved by the skin against each
// other: who is not in it was further away than the distance and the skin.
struct Meeting {
  static constexpr double SKIN = 0.4;  // of the distance
  struct Pair { int32_t i, j; };
  std::vector<R> searched, impulses;  // [point][3], [point][4]: the sum, and how many
  std::vector<int32_t> order;
  std::vector<Pair> pairs, touching;

  void act(const Frame &f, R *rows) {
    if (stale(f, rows)) search(f, rows);
    touching.clear();
    for (const Pair &pair : pairs) {
      const R *one = rows + ROW * pair.i, *two = rows + ROW * pair.j;
      R square = 0, closing = 0;
      for (int k = 0; k < 3; ++k) {
        square += (two[k] - one[k]) * (two[k] - one[k]);
        closing += (two[k] - one[k]) * (two[3 + k] - one[3 + k]);
      }
      if (!(square < f.meeting[0] && closing < 0)) continue;
      touching.push_back(pair);
      impulses[SHORT * pair.i + 3] += 1;
      impulses[SHORT * pair.j + 3] += 1;
    }
    for (const Pair &pair : touching) hit(f, rows, pair);
    for (const Pair &pair : touching)
      for (const int32_t point : {pair.i, pair.j})
        for (int k = 0; k < SHORT; ++k) {
          R &impulse = impulses[SHORT * point + k];
          if (k < 3) rows[ROW * point + 3 + k] += impulse * f.inverse_mass[point];
          impulse = 0;
        }
  }

 private:
  // The law of impact and friction, as contacts/coulomb.py has it.
  void hit(const Frame &f, const R *rows, const Pair &pair) {
    const R *one = rows + ROW * pair.i, *two = rows + ROW * pair.j, e = f.meeting[1], mu = f.meeting[2];
    R axis[3], relative[3], square = 0, approach = 0, slip = 0;
    for (int k = 0; k < 3; ++k) {
      axis[k] = two[k] - one[k];
      relative[k] = two[3 + k] - one[3 + k];
      square += axis[k] * axis[k];
    }
    const R length = std::max(std::sqrt(square), std::sqrt(SHORTEST_SQUARED));
    for (int k = 0; k < 3; ++k) approach -= relative[k] * (axis[k] /= length);
    for (int k = 0; k < 3; ++k) {
      relative[k] += approach * axis[k];
      slip += relative[k] * relative[k];
    }
    const R kept = std::max(1 - mu * (1 + e) * approach / std::max(std::sqrt(slip), SLOWEST), R(0));
    R *first = &impulses[SHORT * pair.i], *second = &impulses[SHORT * pair.j];
    const R reduced = 1 / (f.inverse_mass[pair.i] + f.inverse_mass[pair.j]) / std::max(first[3], second[3]);
    for (int k = 0; k < 3; ++k) {
      const R impulse = reduced * ((1 + e) * approach * axis[k] + (kept - 1) * relative[k]);
      second[k] += impulse;
      first[k] -= impulse;
    }
  }

  // How far two points can have moved against each other: the diagonal of the box of all ways.
  bool stale(const Frame &f, const R *rows) const {
    if (searched.empty()) return true;
    R diagonal = 0;
    for (int k = 0; k < 3; ++k) {
      R low = rows[k] - searched[k], high = low;
      for (int64_t point = 1; point < f.points; ++point) {
        const R way = rows[ROW * point + k] - searched[3 * point + k];
        low = std::min(low, way);
        high = std::max(high, way);
      }
      diagonal += (high - low) * (high - low);
    }
    return diagonal > SKIN * SKIN * f.meeting[0];
  }

  // Along the longest axis, only those that follow within reach have to be looked at.
  void search(const Frame &f, const R *rows) {
    searched.resize(3 * f.points);
    impulses.resize(SHORT * f.points);
    order.resize(f.points);
    pairs.clear();
    R longest = -1;
    int along = 0;
    for (int k = 0; k < 3; ++k) {
      R low = rows[k], high = rows[k];
      for (int64_t point = 0; point < f.points; ++point) {
        const R at = searched[3 * point + k] = rows[ROW * point + k];
        if (!std::isfinite(at)) return;  // the rollout is about to say so
        low = std::min(low, at);
        high = std::max(high, at);
      }
      if (high - low > longest) longest = high - low, along = k;
    }
    for (int64_t point = 0; point < f.points; ++point) order[point] = int32_t(point);
    const auto at = [&](int32_t point) { return rows[ROW * point + along]; };
    std::sort(order.begin(), order.end(), [&](int32_t a, int32_t b) { return at(a) < at(b); });
    const R reach = R(1 + SKIN) * std::sqrt(f.meeting[0]);
    for (size_t a = 0; a < order.size(); ++a)
      for (size_t b = a + 1; b < order.size() && at(order[b]) - at(order[a]) < reach; ++b) {
        const Pair pair = {std::min(order[a], order[b]), std::max(order[a], order[b])};
        if (apart(rows, ROW, pair) < reach * reach && apart(f.rest, 3, pair) >= f.meeting[0] && !joined(f, pair))
          pairs.push_back(pair);
      }
  }

  static R apart(const R *places, int width, const Pair &pair) {
    R square = 0;
    for (int k = 0; k < 3; ++k) {
      const R way = places[width * pair.j + k] - places[width * pair.i + k];
      square += way * way;
    }
    return square;
  }

  static bool joined(const Frame &f, const Pair &pair) {
    const int32_t *begin = f.joined + f.joined_start[pair.i], *end = f.joined + f.joined_start[pair.i + 1];
    return std::find(begin, end, pair.j) != end;
  }
};
