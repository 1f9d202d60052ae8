// State that pages share: the address, data from the daemon, and its updates.
import { useEffect, useRef, useState } from 'preact/hooks';
import { Failure, get, rigPath, type ApiError } from './api';
import type { Change } from './contract';
import { openStream } from './stream';

// ------------------------------------------------------------- addresses

const listeners = new Set<() => void>();

export function go(address: string, replace = false): void {
  if (replace) history.replaceState(null, '', address);
  else history.pushState(null, '', address);
  listeners.forEach((tell) => tell());
}

addEventListener('popstate', () => listeners.forEach((tell) => tell()));

export function useAddress(): URL {
  const [url, setUrl] = useState(() => new URL(location.href));
  useEffect(() => {
    const tell = () => setUrl(new URL(location.href));
    listeners.add(tell);
    return () => {
      listeners.delete(tell);
    };
  }, []);
  return url;
}

// The address of this page with other values in its query; empty values are
// removed.
export function withQuery(values: Record<string, string>): string {
  const url = new URL(location.href);
  for (const [key, value] of Object.entries(values)) {
    if (value) url.searchParams.set(key, value);
    else url.searchParams.delete(key);
  }
  return url.pathname + url.search;
}

// ------------------------------------------------------------- reading

export interface Read<T> {
  value: T | null;
  error: ApiError | null;
  busy: boolean; // a request is in progress
}

// Reads a path, and reads it again when `version` changes; the old value is
// kept until the new one arrives. A null path reads nothing.
export function useRead<T>(path: string | null, version = 0): Read<T> {
  const [read, setRead] = useState<{
    value: T | null;
    error: ApiError | null;
    path: string | null;
    version: number;
  }>({ value: null, error: null, path: null, version });
  useEffect(() => {
    if (path === null) return;
    let gone = false;
    get<T>(path).then(
      (value) => !gone && setRead({ value, error: null, path, version }),
      (failure: Failure) => !gone && setRead({ value: null, error: failure.error, path, version }),
    );
    return () => {
      gone = true;
    };
  }, [path, version]);
  if (read.path !== path) return { value: null, error: null, busy: true };
  return { ...read, busy: read.version !== version };
}

// Limits how often the version changes, for requests that cost the daemon more.
export function useCalm(version: number, leastMs: number): number {
  const [calm, setCalm] = useState(version);
  const last = useRef(0);
  useEffect(() => {
    if (version === calm) return;
    const timer = setTimeout(
      () => {
        last.current = Date.now();
        setCalm(version);
      },
      Math.max(0, last.current + leastMs - Date.now()),
    );
    return () => clearTimeout(timer);
  }, [version, calm, leastMs]);
  return calm;
}

// ------------------------------------------------------------- live

const kSettleMs = 400;

// A version that is incremented when something has changed, in one rig or, with
// '', in any; once for a burst of changes.
export function useLive(rig: string): { version: number; live: boolean } {
  const [version, setVersion] = useState(0);
  const [live, setLive] = useState(false);
  const timer = useRef<number | undefined>(undefined);
  useEffect(() => {
    let first = true;
    const changed = () => {
      setLive(true);
      if (first) {
        // The stream is connected: the data that was read before is up to date.
        first = false;
        return;
      }
      if (timer.current !== undefined) return;
      timer.current = window.setTimeout(() => {
        timer.current = undefined;
        setVersion((count) => count + 1);
      }, kSettleMs);
    };
    const close = openStream<Change>((rig ? rigPath(rig) + '/' : '') + 'changes:watch', {
      onMessage: changed,
      onOpen: () => setLive(true),
      onLost: () => setLive(false),
    });
    return () => {
      close();
      clearTimeout(timer.current);
      timer.current = undefined;
    };
  }, [rig]);
  return { version, live };
}
