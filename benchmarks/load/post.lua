-- wrk: submissions of a clip, each with other bytes at its end (a box that players skip), or they would be one job.
local clip = io.open(os.getenv('CLIP'), 'rb'):read('*a')
local thread = 0
local headers = {
  ['Authorization'] = 'Bearer ' .. os.getenv('KEY'),
  ['Content-Type'] = 'video/mp4',
}
local threads = {}

function setup(each)
  thread = thread + 1
  each:set('thread', thread)
  table.insert(threads, each)
end

function init()
  count, ok, busy, wrong = 0, 0, 0, 0
end

function request()
  count = count + 1
  local mark = string.format('%08d%08d%016d', thread, count, os.time())
  return wrk.format('POST', '/twins', headers, clip .. '\0\0\0\40free' .. mark)
end

function response(status)
  if status == 202 then ok = ok + 1
  elseif status == 429 or status == 503 then busy = busy + 1
  else wrong = wrong + 1 end
end

function done(summary, latency)
  local total = { ok = 0, busy = 0, wrong = 0 }
  for _, each in ipairs(threads) do
    for name in pairs(total) do total[name] = total[name] + each:get(name) end
  end
  io.write(string.format(
    'RESULT {"seconds": %f, "ok": %d, "busy": %d, "wrong": %d, "p50": %f, "p90": %f, "p99": %f, "max": %f}\n',
    summary.duration / 1e6, total.ok, total.busy, total.wrong + summary.errors.timeout + summary.errors.connect,
    latency:percentile(50) / 1e3, latency:percentile(90) / 1e3, latency:percentile(99) / 1e3, latency.max / 1e3))
end
