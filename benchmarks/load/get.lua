-- wrk: how a job stands, of jobs in turn.
local urls = {}
for url in string.gmatch(os.getenv('URLS'), '%S+') do table.insert(urls, url) end
local thread = 0
local headers = { ['Authorization'] = 'Bearer ' .. os.getenv('KEY') }
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
  return wrk.format('GET', urls[count % #urls + 1], headers)
end

function response(status)
  if status == 200 then ok = ok + 1
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
