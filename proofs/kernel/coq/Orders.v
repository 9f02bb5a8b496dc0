(** What is known of the order of time points decides comparisons before anything has to be refuted. *)

Require Import Reals QArith Qreals List Bool PArith ZArith Lra Lia FMapPositive Classical.
Require Import Spec States Kernel Checker.
Import ListNotations.
Open Scope R_scope.

Definition orders := M.t (M.t Q).
Definition key := Pos.of_succ_nat.

Definition bound (o : orders) (a b : nat) : option Q :=
  match M.find (key a) o with Some row => M.find (key b) row | None => None end.

Definition learnt (o : orders) (a b : nat) (k : Q) : orders :=
  M.add (key a) (M.add (key b) k (match M.find (key a) o with Some row => row | None => M.empty Q end)) o.

(** The time points of [t_b - t_a]. *)
Definition gap_of (l : list (var * Q)) : option (nat * nat) :=
  match l with
  | [(VTime x, q); (VTime y, r)] =>
      if Qeq_bool q 1 && Qeq_bool r (-(1)) then Some (y, x)
      else if Qeq_bool q (-(1)) && Qeq_bool r 1 then Some (x, y) else None
  | _ => None
  end.

Definition sure (s : bool) (q : Q) : bool := if s then positive_q q else Qle_bool 0 q.
Definition in_order (o : orders) (a b : nat) : bool := match bound o a b with Some k => Qle_bool 0 k | None => false end.

(** Where the free instant [VNow] is: inside of an action, after everything that happens, or anywhere. *)
Inductive place := Anywhere | Inside (s e : nat) | AfterAll (happening : M.t unit).

Definition decide (o : orders) (i : place) (s : bool) (e : lin) : option bool :=
  match snd e with
  | [] => Some (sure s (fst e))
  | [(VNow, q); (VTime p, r)] =>
      if Qeq_bool q 1 && Qeq_bool r (-(1)) && Qeq_bool (fst e) 0 then
        match i with
        | Inside from until =>
            if in_order o p from then Some true
            else if in_order o until p then Some false else None
        | AfterAll happening => match M.find (key p) happening with Some _ => if s then None else Some true | None => None end
        | Anywhere => None
        end
      else None
  | l =>
      match gap_of l with
      | Some (a, b) =>
          if match bound o a b with Some k => sure s (fst e + k) | None => false end then Some true
          else if match bound o b a with Some k => sure (negb s) (k - fst e) | None => false end then Some false
          else None
      | None => None
      end
  end.

Fixpoint simp (o : orders) (i : place) (f : form) : form :=
  match f with
  | FTrue => FTrue
  | FCmp s e => match decide o i s e with Some true => FTrue | Some false => FNot FTrue | None => f end
  | FNot f => match simp o i f with FNot h => h | h => FNot h end
  | FAnd f h =>
      match simp o i f with
      | FTrue => simp o i h
      | FNot FTrue => FNot FTrue
      | f' => match simp o i h with FTrue => f' | FNot FTrue => FNot FTrue | h' => FAnd f' h' end
      end
  end.

(** Equations among formulas that are true: [x + e = 0], with e over times and parameters, says what stands in for x. *)
Definition number_of (x : var) : positive :=
  match x with VJump w true _ => xO (key w) | VJump w false _ => xI (key w) | _ => 1%positive end.

Definition equation (f : form) : option (var * lin) :=
  match f with
  | FAnd (FCmp false (c, (x, q) :: e)) (FCmp false d) =>
      if Qeq_bool q 1 && timeless_lin (c, e) && zero (plus_times d 1 (c, (x, q) :: e)) then Some (x, (c, e)) else None
  | _ => None
  end.

Definition solved (l : list form) : M.t (var * lin) :=
  fold_right (fun f m => match equation f with Some s => M.add (number_of (fst s)) s m | None => m end) (M.empty _) l.

Fixpoint filled (m : M.t (var * lin)) (l : list (var * Q)) (e : lin) : lin :=
  match l with
  | [] => e
  | (x, q) :: l =>
      let kept := (fst e, add_term x q (snd e)) in
      filled m l match M.find (number_of x) m with Some (y, d) => if var_eqb x y then plus_times e (-q) d else kept | _ => kept end
  end.

Fixpoint fill (m : M.t (var * lin)) (f : form) : form :=
  match f with
  | FTrue => FTrue
  | FCmp s (c, l) => FCmp s (filled m l (c, []))
  | FNot f => FNot (fill m f)
  | FAnd f h => FAnd (fill m f) (fill m h)
  end.

(** The first formula, and others if it is not false by itself, as far as orders and equations simplify them. *)
Definition simplified (o : orders) (i : place) (first : form) (others : unit -> list form) : form * list form :=
  match simp o i first with
  | FNot FTrue => (FNot FTrue, [])
  | claim =>
      let l := map (simp o i) (others tt) in
      let m := solved l in
      (simp o i (fill m claim), map (fun f => simp o i (fill m f)) l)
  end.

Section Simplify.
Variable P : plan.
Variable g t : nat -> R.
Variable time : R.
Variable o : orders.
Variable i : place.
Local Notation v := (valuation P g t time).
Definition ordered (o : orders) : Prop := forall a b k, bound o a b = Some k -> Q2R k <= t b - t a.
Definition in_it (i : place) : Prop :=
  match i with
  | Anywhere => True
  | Inside s e => t s < time < t e
  | AfterAll happening => forall p x, M.find (key p) happening = Some x -> t p <= time
  end.

Lemma learnt_ordered a b k o' : ordered o' -> Q2R k <= t b - t a -> ordered (learnt o' a b k).
Proof.
  intros O L x y q. unfold bound, learnt. destruct (Pos.eq_dec (key x) (key a)) as [E|E].
  - rewrite E, M.gss. apply SuccNat2Pos.inj in E. subst x. destruct (Pos.eq_dec (key y) (key b)) as [E|E].
    + rewrite E, M.gss. apply SuccNat2Pos.inj in E. subst y. intros H. inversion H. now subst.
    + rewrite M.gso by auto. intros H. apply O. unfold bound. destruct (M.find (key a) o'); auto.
      now rewrite M.gempty in H.
  - rewrite M.gso by auto. apply O.
Qed.

Hypothesis O : ordered o.
Hypothesis I : in_it i.

Lemma sure_true s q : sure s q = true <-> above s (Q2R q).
Proof. destruct s; simpl; [apply positive_q_dec | apply Qle_bool_R]. Qed.

Lemma minus_one_R : Q2R (-(1)) = -1.
Proof. rewrite Q2R_opp, one_R. lra. Qed.

Lemma gap_of_at l a b : gap_of l = Some (a, b) -> terms_at v l = t b - t a.
Proof.
  destruct l as [|[[j | x | | w r m | k m | w | w | x s m | k m] q] [|[[j' | y | | w' r' m' | k' m' | w' | w' | x' s' m' | k' m'] q'] [|? ?]]]; try easy. simpl.
  unfold terms_at. simpl. destruct (Qeq_bool q 1 && Qeq_bool q' (-(1))) eqn:E.
  - apply andb_true_iff in E as [A B]. apply Qeq_R in A. apply Qeq_R in B.
    rewrite A, B, one_R, minus_one_R. intros H. inversion H. subst. lra.
  - destruct (Qeq_bool q (-(1)) && Qeq_bool q' 1) eqn:E'; [|easy].
    apply andb_true_iff in E' as [A B]. apply Qeq_R in A. apply Qeq_R in B.
    rewrite A, B, one_R, minus_one_R. intros H. inversion H. subst. lra.
Qed.

Lemma gap_decided s e a b r : gap_of (snd e) = Some (a, b) ->
  (if match bound o a b with Some k => sure s (fst e + k) | None => false end then Some true
   else if match bound o b a with Some k => sure (negb s) (k - fst e) | None => false end then Some false
   else None) = Some r -> (above s (at_ v e) <-> r = true).
Proof.
  intros G. apply gap_of_at in G. unfold at_. rewrite G.
  destruct (bound o a b) as [k|] eqn:B; [destruct (sure s (fst e + k)) eqn:S|].
  1: { apply O in B. apply sure_true in S. rewrite Q2R_plus in S. intros H. inversion H. destruct s; simpl in *; split; auto; intros; lra. }
  all: destruct (bound o b a) as [k'|] eqn:B'; [|easy]; destruct (sure (negb s) (k' - fst e)) eqn:S'; [|easy];
    apply O in B'; apply sure_true in S'; unfold Qminus in S'; rewrite Q2R_plus, Q2R_opp in S'; intros H; inversion H;
    destruct s; simpl in *; split; try easy; intros; lra.
Qed.

Lemma nonnegative a b : in_order o a b = true -> t a <= t b.
Proof.
  unfold in_order. destruct (bound o a b) as [k|] eqn:E; [|easy]. intros K. apply O in E. apply Qle_bool_R in K. lra.
Qed.

Lemma decide_true s e r : decide o i s e = Some r -> (above s (at_ v e) <-> r = true).
Proof.
  unfold decide. destruct (snd e) as [|[x q] l] eqn:E.
  - intros H. inversion H. rewrite sure_true. unfold at_. rewrite E. unfold terms_at. simpl.
    rewrite Rplus_0_r. reflexivity.
  - destruct x as [j | x | | w b m | k m | w | w | y s' m | k m]; try (simpl; easy).
    + rewrite <- E. destruct (gap_of (snd e)) as [[a b]|] eqn:G; [|easy]. now apply gap_decided.
    + destruct l as [|[[j | p | | w b m | k m | w | w | y s' m | k m] q'] [|? ?]]; try (simpl; easy).
      destruct (Qeq_bool q 1 && Qeq_bool q' (-(1)) && Qeq_bool (fst e) 0) eqn:Z; [|easy].
      apply andb_true_iff in Z as [Z C]. apply andb_true_iff in Z as [A B].
      apply Qeq_R in A. apply Qeq_R in B. apply Qeq_R in C.
      unfold at_. rewrite E, C, zero_R. unfold terms_at. simpl. rewrite A, B, one_R, minus_one_R.
      destruct i as [| from until | happening]; [easy| |]; simpl in I.
      * destruct (in_order o p from) eqn:K; [|destruct (in_order o until p) eqn:K'; [|easy]].
        -- apply nonnegative in K. intros H. inversion H. destruct s; simpl; split; auto; intros; lra.
        -- apply nonnegative in K'. intros H. inversion H. destruct s; simpl; split; try easy; intros; lra.
      * destruct (M.find (key p) happening) as [x|] eqn:K; [|easy]. apply I in K. destruct s; [easy|].
        intros H. inversion H. simpl. split; auto. intros _. lra.
Qed.

Lemma simp_true f : fval v (simp o i f) <-> fval v f.
Proof.
  induction f as [| s e | f IH | f IHf h IHh]; simpl; try tauto.
  - destruct (decide o i s e) as [[]|] eqn:D; simpl; try tauto; apply decide_true in D; intuition congruence.
  - destruct (simp o i f) as [| s e | f' | f' h']; simpl in *; try tauto.
  - destruct (simp o i f) as [| s e | [| s e | f' | f' h'] | f' h']; simpl in *; try tauto;
    destruct (simp o i h) as [| s2 e2 | [| s2 e2 | f2 | f2 h2] | f2 h2]; simpl in *; tauto.
Qed.

Lemma solved_at l : (forall f, In f l -> fval v f) -> forall n x e, M.find n (solved l) = Some (x, e) -> v x + at_ v e = 0.
Proof.
  induction l as [|f l IH]; cbn [solved fold_right]; intros T n x e; [now rewrite M.gempty|]. fold (solved l).
  assert (H : M.find n (solved l) = Some (x, e) -> v x + at_ v e = 0) by (apply IH; intros h J; apply T; now right).
  destruct (equation f) as [s|] eqn:E; [|exact H]. destruct (Pos.eq_dec n (number_of (fst s))) as [->|D].
  2: now rewrite M.gso. rewrite M.gss. intros K. inversion K. subst s. clear K H IH. specialize (T f (or_introl eq_refl)).
  destruct f as [| | | f h]; try easy. destruct f as [| [] [c [|[y q] r]] | |], h as [| [] d | |]; try easy. simpl in E.
  destruct (Qeq_bool q 1 && _ && _) eqn:B; [|easy]. inversion E. subst. apply andb_true_iff in B as [B Z].
  apply andb_true_iff in B as [B _]. apply Qeq_R in B. apply (zero_at v) in Z. rewrite plus_times_at, one_R in Z.
  simpl in T. unfold at_, terms_at in *. simpl in *. rewrite B, one_R in T, Z. lra.
Qed.

Lemma fill_true m f : (forall n x e, M.find n m = Some (x, e) -> v x + at_ v e = 0) -> (fval v (fill m f) <-> fval v f).
Proof.
  intros S. induction f as [| s [c l] | f IH | f IHf h IHh]; simpl; try tauto.
  enough (H : forall e, at_ v (filled m l e) = at_ v e + terms_at v l)
    by (rewrite H; unfold at_, terms_at; simpl; now rewrite Rplus_0_r).
  induction l as [|[x q] l IH]; intros e; simpl; [unfold terms_at; simpl; lra|]. rewrite IH.
  assert (A : at_ v (fst e, add_term x q (snd e)) = at_ v e + Q2R q * v x) by (unfold at_; simpl; rewrite add_term_at; lra).
  destruct (M.find _ m) as [[y d]|] eqn:F; [destruct (var_eqb x y) eqn:E|]; rewrite ?A; try (unfold terms_at; simpl; lra).
  apply var_eqb_true in E. subst y. apply S in F. rewrite plus_times_at, Q2R_opp. unfold terms_at. simpl.
  fold (terms_at v l). replace (at_ v d) with (- v x) by lra. lra.
Qed.

Lemma simplified_true first others : fval v first -> (forall f, In f (others tt) -> fval v f) ->
  let (claim, rest) := simplified o i first others in fval v claim /\ forall f, In f rest -> fval v f.
Proof.
  intros T S. apply simp_true in T. unfold simplified. assert (H : let m := solved (map (simp o i) (others tt)) in
    fval v (simp o i (fill m (simp o i first))) /\
    forall f, In f (map (fun f => simp o i (fill m f)) (map (simp o i) (others tt))) -> fval v f).
  { assert (L : forall f, In f (map (simp o i) (others tt)) -> fval v f)
      by (intros f I'; apply in_map_iff in I' as [h [<- J]]; apply simp_true; auto).
    split; [|intros f J; apply in_map_iff in J as [h [<- J]]]; apply simp_true, fill_true; auto; now apply solved_at. }
  destruct (simp o i first) as [| s e | [| s e | f | f h] | f h]; try exact H. now elim T.
Qed.

End Simplify.
