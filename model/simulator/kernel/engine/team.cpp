// Who does what: each thread has a share of the pieces of every phase. Who is done with its own takes others', and
// the next phase begins when all pieces are done - not when all threads are there, so one that the system has put
// aside holds nobody up. What a piece does, and in which order, is the same whoever does it.
struct Team {
  enum { PATIENCE = 40000 };
  int threads;
  std::vector<std::atomic<int32_t>> taken, done;
  // one thread alone counts nothing
  Team(int threads, int64_t phases)
      : threads(threads), taken(threads > 1 ? phases * threads : 0), done(threads > 1 ? phases : 0) {}

  template <class Work>
  LAW void share(int64_t phase, int thread, int64_t pieces, Work work) {
    if (threads == 1) {
      for (int64_t piece = 0; piece < pieces; ++piece) work(piece);
      return;
    }
    for (int other = 0; other < threads; ++other) {
      const int owner = (thread + other) % threads;
      const int64_t begin = pieces * owner / threads, length = pieces * (owner + 1) / threads - begin;
      for (int64_t piece; (piece = taken[phase * threads + owner].fetch_add(1)) < length;) {
        work(begin + piece);
        done[phase].fetch_add(1, std::memory_order_release);
      }
    }
    for (int spin = 0; done[phase].load(std::memory_order_acquire) < pieces; ++spin)
      if (spin > PATIENCE) sched_yield();
  }

  // The same for things of which there are many.
  template <class Work>
  LAW void share_many(int64_t phase, int thread, int64_t things, Work work) {
    const int64_t pieces = 8 * threads;
    share(phase, thread, pieces, [&](int64_t p) { work(things * p / pieces, things * (p + 1) / pieces); });
  }
};

// One parallel region for all substeps: a batch by elements, one element by all threads together.
template <class Work>
static void share_out(const Frame *frames, int batch, int threads, Work work) {
  Team together(batch > 1 ? 1 : threads, 5 * frames[0].steps + 1);
  std::atomic<int> taken(0);
#pragma omp parallel num_threads(threads)
  {
    const int thread = omp_get_thread_num();
    if (batch == 1)
      work(frames[0], together, thread);
    else
      for (int b; (b = taken.fetch_add(1)) < batch;) {
        Team alone(1, 0);
        work(frames[b], alone, 0);
      }
  }
}
